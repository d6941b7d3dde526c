// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/remote_artifacts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <sstream>
#include <thread>

#include "services/rpc/server.h"
#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::lease {
namespace {

/// Holds everything in memory, and spoils what it is told to.
class FakeArtifacts final : public v1::Artifacts::Service {
 public:
  FakeArtifacts() { server_ = *rpc::StartServer({.services = {this}}); }
  const std::string& address() const { return server_->address(); }

  grpc::Status Get(grpc::ServerContext*, const v1::GetArtifactRequest* request, grpc::ServerWriter<v1::ArtifactChunk>* writer) override {
    ++gets;
    const auto found = files.find(request->name().digest());
    if (found == files.end()) return {grpc::StatusCode::NOT_FOUND, "there is no such file"};
    std::string bytes = found->second;
    if (spoil-- > 0) bytes[0] ^= 1;
    v1::ArtifactChunk chunk;
    chunk.set_size(static_cast<std::int64_t>(bytes.size()));
    if (request->name().kind() == v1::ArtifactName::RESULT) chunk.set_sha256(base::HashBytes(found->second).Hex());
    chunk.set_data(bytes.substr(0, bytes.size() / 2));
    writer->Write(chunk);
    if (breaks-- > 0) return {grpc::StatusCode::UNAVAILABLE, "a break in mid-transfer"};
    chunk.Clear();
    chunk.set_data(bytes.substr(bytes.size() / 2));
    writer->Write(chunk);
    return grpc::Status::OK;
  }

  grpc::Status Put(grpc::ServerContext*, grpc::ServerReader<v1::PutArtifactChunk>* reader, v1::PutArtifactReply*) override {
    v1::PutArtifactChunk first, chunk;
    reader->Read(&first);
    if (breaks-- > 0) return {grpc::StatusCode::UNAVAILABLE, "a break in mid-transfer"};
    std::string bytes;
    while (reader->Read(&chunk)) bytes += chunk.data();
    if (files.contains(first.name().digest())) return {grpc::StatusCode::ALREADY_EXISTS, "another is there"};
    if (refuse) return {grpc::StatusCode::FAILED_PRECONDITION, "no leased task has this key"};
    files[first.name().digest()] = bytes;
    return grpc::Status::OK;
  }

  std::map<std::string, std::string> files;
  std::atomic<int> gets = 0, breaks = 0, spoil = 0;
  std::atomic<bool> refuse = false;

 private:
  std::unique_ptr<rpc::Server> server_;
};

class RemoteArtifactsTest : public testing::Test {
 protected:
  void Open(std::int64_t limit = 1 << 30, absl::Duration patience = absl::Seconds(20)) {
    auto remote = RemoteArtifacts::Open({.scheduler = scheduler_.address(), .cache = cache_.path(), .cache_limit = limit, .patience = patience});
    ASSERT_TRUE(remote.ok()) << remote.status();
    remote_ = *std::move(remote);
  }
  tasks::Input Blob(const std::string& bytes) {
    const base::Digest digest = base::HashBytes(bytes);
    scheduler_.files[digest.Hex()] = bytes;
    return {.role = "frame", .source = tasks::Input::Source::kBlob, .extension = ".ply", .digest = digest};
  }
  static tasks::TaskSpec Reading(std::vector<tasks::Input> inputs) { return {tasks::Kind::kTessellate, nlohmann::json::object(), std::move(inputs)}; }
  auto Bring(const tasks::TaskSpec& spec) { return remote_->Bring(spec, stop_); }
  std::string InCache(const tasks::Input& input) {
    std::ifstream file(remote_->store().BlobPath(*input.digest, input.extension));
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
  }
  base::Digest Make(const std::string& what, const std::string& bytes) {
    const base::Digest key = base::HashBytes(what);
    const auto temporary = remote_->store().TemporaryPath(".h5");
    std::ofstream(temporary) << bytes;
    EXPECT_TRUE(remote_->store().PublishArtifact(temporary, key, ".h5").ok());
    return key;
  }

  FakeArtifacts scheduler_;
  TemporaryFolder cache_;
  StopFlag stop_;
  std::unique_ptr<RemoteArtifacts> remote_;
};

TEST_F(RemoteArtifactsTest, BringsInputsOnce) {
  Open();
  const tasks::Input one = Blob("one"), two = Blob("two");
  tasks::Input missing = one;
  missing.digest.reset();
  const auto holds = Bring(Reading({one, missing, two, one}));
  ASSERT_TRUE(holds.ok()) << holds.status();
  EXPECT_EQ(InCache(one), "one");
  EXPECT_EQ(InCache(two), "two");
  ASSERT_TRUE(Bring(Reading({one, two})).ok());
  EXPECT_EQ(scheduler_.gets, 2);
}

TEST_F(RemoteArtifactsTest, AttemptsThatWantTheSameShareItsTransfer) {
  Open();
  const tasks::Input input = Blob(std::string(500'000, 'x'));
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i) threads.emplace_back([&] { EXPECT_TRUE(Bring(Reading({input})).ok()); });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(scheduler_.gets, 1);
}

TEST_F(RemoteArtifactsTest, TriesAgainAfterABreakAndAfterDamage) {
  Open();
  scheduler_.breaks = 2;
  scheduler_.spoil = 0;
  const tasks::Input broken = Blob("broken twice");
  const auto holds = Bring(Reading({broken}));
  ASSERT_TRUE(holds.ok()) << holds.status();
  EXPECT_EQ(InCache(broken), "broken twice");
  scheduler_.breaks = 0;
  scheduler_.spoil = 1;
  const tasks::Input damaged = Blob("damaged once");
  ASSERT_TRUE(Bring(Reading({damaged})).ok());
  EXPECT_EQ(InCache(damaged), "damaged once");
  scheduler_.spoil = 1000;
  const tasks::Input wrong = Blob("always wrong");
  EXPECT_EQ(Bring(Reading({wrong})).status().code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(InCache(wrong), "") << "what does not have its digest is never published";
  EXPECT_TRUE(std::filesystem::is_empty(cache_.path() / "tmp"));
}

TEST_F(RemoteArtifactsTest, SaysWhichInputIsNotThere) {
  Open();
  tasks::Input input = Blob("x");
  scheduler_.files.clear();
  const auto holds = Bring(Reading({input}));
  EXPECT_EQ(holds.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(holds.status().message()), testing::HasSubstr("input frame " + input.digest->Short()));
}

TEST_F(RemoteArtifactsTest, EndsWhenItIsStopped) {
  Open(1 << 30, absl::Hours(1));
  scheduler_.breaks = 1'000'000;
  const tasks::Input input = Blob("never");
  std::thread stopper([&] {
    while (scheduler_.gets < 2) std::this_thread::yield();
    stop_.Stop();
  });
  EXPECT_EQ(Bring(Reading({input})).status().code(), absl::StatusCode::kCancelled);
  stopper.join();
}

TEST_F(RemoteArtifactsTest, DeliversAResultThroughABreak) {
  Open();
  const base::Digest key = Make("task", std::string(2'500'000, 'r'));
  scheduler_.breaks = 2;
  const absl::Status status = remote_->Deliver(key, ".h5", stop_);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(scheduler_.files[key.Hex()], std::string(2'500'000, 'r'));
}

TEST_F(RemoteArtifactsTest, TakesTheResultThatWasThereFirst) {
  Open();
  const base::Digest key = Make("task", "mine");
  scheduler_.files[key.Hex()] = "first";
  const absl::Status status = remote_->Deliver(key, ".h5", stop_);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(*base::HashFile(remote_->store().ArtifactPath(key, ".h5")), base::HashBytes("first"));
}

TEST_F(RemoteArtifactsTest, ARefusedResultIsAnError) {
  Open();
  scheduler_.refuse = true;
  EXPECT_EQ(remote_->Deliver(Make("task", "mine"), ".h5", stop_).code(), absl::StatusCode::kFailedPrecondition);
}

TEST_F(RemoteArtifactsTest, TheCacheKeepsItsLimitAndWhatIsInUse) {
  Open(2500);
  const auto old_time = [&](const tasks::Input& input, int age) {
    std::filesystem::last_write_time(remote_->store().BlobPath(*input.digest, ".ply"),
                                     std::filesystem::file_time_type::clock::now() - std::chrono::hours(age));
  };
  const tasks::Input held = Blob(std::string(1000, 'h')), old = Blob(std::string(1000, 'o')), recent = Blob(std::string(1000, 'r'));
  const auto holds = Bring(Reading({held}));
  ASSERT_TRUE(holds.ok());
  old_time(held, 3);
  ASSERT_TRUE(Bring(Reading({old})).ok());
  old_time(old, 2);
  ASSERT_TRUE(Bring(Reading({recent})).ok());
  EXPECT_TRUE(remote_->store().HasBlob(*held.digest, ".ply")) << "used longest ago, but in use";
  EXPECT_FALSE(remote_->store().HasBlob(*old.digest, ".ply"));
  EXPECT_TRUE(remote_->store().HasBlob(*recent.digest, ".ply"));
}

}  // namespace
}  // namespace vorocast::lease
