// SPDX-License-Identifier: AGPL-3.0-or-later
// What disks do: bits flip, files are cut short, there is no room, nothing may be written. No result is ever wrong for it.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <memory>

#include "tests/cluster/farm.h"
#include "tests/cluster/programs.h"
#include "tests/cluster/small_job.h"

namespace vorocast::cluster {
namespace {

namespace fs = std::filesystem;

/// Results in the store, in the order of their keys.
std::vector<fs::path> Results(const fs::path& state) {
  std::vector<fs::path> paths;
  for (const auto& entry : fs::recursive_directory_iterator(state / "artifacts")) {
    if (entry.is_regular_file()) paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

void FlipABit(const fs::path& path) {
  fs::permissions(path, fs::perms::owner_all);
  std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  const auto middle = static_cast<std::streamoff>(fs::file_size(path) / 2);
  file.seekg(middle);
  const char byte = static_cast<char>(file.get() ^ 0x10);
  file.seekp(middle);
  file.put(byte);
}

void CutInHalf(const fs::path& path) {
  fs::permissions(path, fs::perms::owner_all);
  fs::resize_file(path, fs::file_size(path) / 2);
}

TEST(Damage, ResultsThatWereDamagedInTheStoreAreMadeAnewByARetry) {
  ASSERT_FALSE(UndisturbedDigests().empty());
  Farm farm({.folder = Scratch() / "damaged"});
  const Outcome outcome = RunProgram(farm.SubmitArguments(SmallCapture(), {"--watch"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  const std::vector<fs::path> results = Results(farm.state());
  ASSERT_GE(results.size(), 16U);
  for (std::size_t i = 0; i < results.size(); i += 2) {
    if (i % 4 == 0) {
      FlipABit(results[i]);
    } else {
      CutInHalf(results[i]);
    }
  }
  const Outcome retried = RunProgram({"retry", "--to", farm.address()});
  EXPECT_EQ(retried.exit_code, 0) << retried.output;
  const Outcome watched = RunProgram({"watch", "--to", farm.address()});
  EXPECT_EQ(watched.exit_code, 0) << watched.output;
  EXPECT_EQ(farm.FetchedDigests(), UndisturbedDigests());
}

TEST(Damage, AResultThatIsDamagedBeforeItIsReadEndsInAnErrorAndNeverInAnotherResult) {
  ASSERT_FALSE(UndisturbedDigests().empty());
  Farm farm({.folder = Scratch() / "damaged-early"});
  // Frames only: nothing that reads their cells is planned before the take is over.
  const fs::path stage = Scratch() / "damaged-early" / "stage";
  fs::create_directories(stage);
  for (const auto& entry : fs::directory_iterator(SmallCapture())) {
    if (entry.path().extension() != ".h5") fs::copy(entry.path(), stage);
  }
  Running follower(farm.SubmitArguments(stage, {"--follow", "--settle", "50", "--idle", "0", "--watch"}));
  ASSERT_TRUE(Eventually([&] { return Results(farm.state()).size() >= 13; })) << "twelve frames and a template";
  // Their digests are on record too, not only the files there.
  ASSERT_TRUE(Eventually([&] { return RunProgram({"explain", "--to", farm.address()}).output.find("waits for frames") != std::string::npos; }));
  for (const fs::path& result : Results(farm.state())) FlipABit(result);
  std::ofstream(stage / "capture.done").close();
  const Outcome failed = follower.Wait();
  EXPECT_EQ(failed.exit_code, 1) << failed.output;
  EXPECT_NE(failed.output.find("is damaged in the store; 'vorocast retry'"), std::string::npos) << failed.output;
  EXPECT_EQ(RunProgram({"retry", "--to", farm.address()}).exit_code, 0);
  const Outcome watched = RunProgram({"watch", "--to", farm.address()});
  EXPECT_EQ(watched.exit_code, 0) << watched.output;
  EXPECT_EQ(farm.FetchedDigests(), UndisturbedDigests());
}

/// A file system of its own for a farm's folder, in a mount namespace that ends with this process.
class Disk {
 public:
  /// Null without the right to mount.
  static std::unique_ptr<Disk> Mount(const fs::path& folder) {
    fs::create_directories(folder);
    static const bool apart = unshare(CLONE_NEWNS) == 0 && mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0;
    if (!apart || mount("vorocast", folder.c_str(), "tmpfs", 0, "size=200m") != 0) return nullptr;
    return std::unique_ptr<Disk>(new Disk(folder));
  }
  ~Disk() { umount2(folder_.c_str(), MNT_DETACH); }

  void Fill() const {
    const int file = open((folder_ / "ballast").c_str(), O_WRONLY | O_CREAT, 0600);
    const std::string block(1 << 16, 'x');
    for (std::size_t size = block.size(); size > 0;) {
      if (write(file, block.data(), size) < 0) size /= 2;
    }
    close(file);
  }
  void Empty() const { fs::remove(folder_ / "ballast"); }
  /// Nothing can be written into this folder of the disk any more. False while something is being written.
  static bool Protect(const fs::path& folder) {
    if (mount(folder.c_str(), folder.c_str(), nullptr, MS_BIND, nullptr) != 0) return false;
    if (mount("none", folder.c_str(), nullptr, MS_REMOUNT | MS_BIND | MS_RDONLY, nullptr) == 0) return true;
    umount2(folder.c_str(), MNT_DETACH);
    return false;
  }
  static void Release(const fs::path& folder) { umount2(folder.c_str(), MNT_DETACH); }

 private:
  explicit Disk(fs::path folder) : folder_(std::move(folder)) {}
  fs::path folder_;
};

class DiskTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_FALSE(UndisturbedDigests().empty());
    folder_ = Scratch() / testing::UnitTest::GetInstance()->current_test_info()->name();
    disk_ = Disk::Mount(folder_);
    if (!disk_) GTEST_SKIP() << "a file system for the test cannot be mounted here (that takes root)";
    farm_ = std::make_unique<Farm>(Farm::Options{.folder = folder_});
    job_ = std::make_unique<Running>(farm_->SubmitArguments(SmallCapture(), {"--watch"}));
    ASSERT_TRUE(Eventually([&] { return CountFiles(farm_->state() / "artifacts") >= 3; }));
  }
  std::string Explanation() const { return RunProgram({"explain", "--to", farm_->address()}).output; }
  void ExpectUndisturbedResults() {
    Outcome outcome = job_->Wait();
    if (outcome.exit_code != 0) {
      // Tasks may have used up their attempts meanwhile; a retry is what the message tells to do.
      EXPECT_TRUE(Eventually([&] { return RunProgram({"retry", "--to", farm_->address()}).exit_code == 0; }, 30));
      outcome = RunProgram({"watch", "--to", farm_->address()});
    }
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    EXPECT_EQ(farm_->FetchedDigests(), UndisturbedDigests());
  }
  fs::path folder_;
  std::unique_ptr<Disk> disk_;
  std::unique_ptr<Farm> farm_;
  std::unique_ptr<Running> job_;
};

TEST_F(DiskTest, AFullDiskIsToldAndTheJobGoesOnWhenThereIsRoom) {
  disk_->Fill();
  EXPECT_TRUE(Eventually([&] { return Explanation().find("full") != std::string::npos; }, 60)) << Explanation();
  disk_->Empty();
  ExpectUndisturbedResults();
}

TEST_F(DiskTest, AReadOnlyStoreLosesNothing) {
  ASSERT_TRUE(Eventually([&] { return Disk::Protect(farm_->state() / "tmp"); }));
  EXPECT_TRUE(Eventually([&] { return Explanation().find("Read-only") != std::string::npos; }, 30)) << Explanation();
  Disk::Release(farm_->state() / "tmp");
  ExpectUndisturbedResults();
}

}  // namespace
}  // namespace vorocast::cluster
