// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/store/sqlite_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include <fmt/format.h>

#include "scheduler/store/sqlite_connection.h"
#include "scheduler/store/state_lock.h"

namespace vorocast::store {
namespace {

using testing::HasSubstr;

class SqliteStoreTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              fmt::format("vorocast_store_{}_{}", testing::UnitTest::GetInstance()->current_test_info()->name(), getpid());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    path_ = folder_ / "scheduler.db";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::unique_ptr<Store> Open() {
    auto store = OpenSqliteStore(path_);
    EXPECT_TRUE(store.ok()) << store.status();
    return store.ok() ? *std::move(store) : nullptr;
  }

  static std::vector<Record> Take() {
    return {SequenceOpened{"s1", "monday", "take \"1\"", 29.97, 0.01, "-z"},
            FrameAdded{"s1", 7, base::HashBytes("seven"), ".ply", 70},
            FrameAdded{"s1", 2, base::HashBytes("two"), ".drc", 20},
            SequenceClosed{"s1"},
            JobAdded{"j1", "s1", "anna", -3, R"({"cells":5})"},
            core::Record(core::TaskFailed{"j1", "frame 2: tessellate", core::Cause::kTimedOut, "too long"}),
            core::Record(core::RunSaved{base::HashBytes("run"), 12, "worker-1", {.failed = 1, .interrupted = 2, .memory_raised = 1}}),
            core::Record(core::AttemptsReserved{1001}),
            core::Record(core::ResultMade{base::HashBytes("key"), {base::HashBytes("bytes"), 99, 1.5, 1.25, 4096, "j1"}})};
  }

  void ExpectTake(Store& store) {
    const auto snapshot = store.Load();
    ASSERT_TRUE(snapshot.ok()) << snapshot.status();
    ASSERT_EQ(snapshot->sequences.size(), 1u);
    const StoredSequence& sequence = snapshot->sequences[0];
    EXPECT_EQ(sequence.opened.name, "take \"1\"");
    EXPECT_EQ(sequence.opened.frames_per_second, 29.97);
    EXPECT_EQ(sequence.opened.up, "-z");
    EXPECT_TRUE(sequence.closed);
    ASSERT_EQ(sequence.frames.size(), 2u);
    EXPECT_EQ(sequence.frames[0].number, 2);
    EXPECT_EQ(sequence.frames[1].blob, base::HashBytes("seven"));
    ASSERT_EQ(snapshot->jobs.size(), 1u);
    EXPECT_EQ(snapshot->jobs[0].added.priority, -3);
    EXPECT_EQ(snapshot->jobs[0].added.spec_json, R"({"cells":5})");
    EXPECT_FALSE(snapshot->jobs[0].cancelled);
    ASSERT_EQ(snapshot->jobs[0].failures.size(), 1u);
    EXPECT_EQ(snapshot->jobs[0].failures[0].cause, core::Cause::kTimedOut);
    ASSERT_EQ(snapshot->runs.size(), 1u);
    EXPECT_EQ(snapshot->runs[0].worker, "worker-1");
    EXPECT_EQ(snapshot->runs[0].attempt, 12);
    EXPECT_EQ(snapshot->runs[0].tries.interrupted, 2);
    EXPECT_EQ(snapshot->attempt_next, 1001);
    const auto result = store.FindResult(base::HashBytes("key"));
    ASSERT_TRUE(result.ok() && result->has_value());
    EXPECT_EQ((*result)->sha256, base::HashBytes("bytes"));
    EXPECT_EQ((*result)->memory_peak, 4096);
    EXPECT_FALSE(store.FindResult(base::HashBytes("other"))->has_value());
  }

  std::filesystem::path folder_;
  std::filesystem::path path_;
};

TEST_F(SqliteStoreTest, RemembersOverAReopening) {
  ASSERT_TRUE(Open()->Append(Take()).ok());
  ExpectTake(*Open());
}

TEST_F(SqliteStoreTest, WritingABatchTwiceIsHarmless) {
  const auto store = Open();
  ASSERT_TRUE(store->Append(Take()).ok());
  ASSERT_TRUE(store->Append(Take()).ok());
  ExpectTake(*store);
}

TEST_F(SqliteStoreTest, EachCommitSurvivesAKill) {
  // What a kill leaves is the files as they are on disk at that moment.
  const auto store = Open();
  ASSERT_TRUE(store->Append(Take()).ok());
  for (const char* file : {"scheduler.db", "scheduler.db-wal"}) std::filesystem::copy_file(folder_ / file, folder_ / (std::string("killed-") + file));
  std::filesystem::rename(folder_ / "killed-scheduler.db-wal", folder_ / "killed.db-wal");
  std::filesystem::rename(folder_ / "killed-scheduler.db", folder_ / "killed.db");
  ASSERT_TRUE(store->Append({core::Record(core::JobCancelled{"j1"})}).ok());
  path_ = folder_ / "killed.db";
  ExpectTake(*Open());
}

TEST_F(SqliteStoreTest, LaterRecordsReplaceEarlierOnes) {
  const auto store = Open();
  ASSERT_TRUE(store->Append(Take()).ok());
  ASSERT_TRUE(store->Append({core::Record(core::JobCancelled{"j1"}), core::Record(core::RunEnded{base::HashBytes("run")})}).ok());
  EXPECT_TRUE(store->Load()->jobs[0].cancelled);
  EXPECT_TRUE(store->Load()->runs.empty());
  ASSERT_TRUE(store->Append({core::Record(core::JobRetried{"j1"})}).ok());
  EXPECT_FALSE(store->Load()->jobs[0].cancelled);
  EXPECT_TRUE(store->Load()->jobs[0].failures.empty());
}

TEST_F(SqliteStoreTest, KeepsTheOrderOfSubmission) {
  const auto store = Open();
  std::vector<Record> records;
  for (int i = 1; i <= 12; ++i) records.push_back(SequenceOpened{fmt::format("s{}", i), "s", fmt::format("n{}", i), 25, 1, "+y"});
  ASSERT_TRUE(store->Append(records).ok());
  const auto snapshot = store->Load();
  for (int i = 1; i <= 12; ++i) EXPECT_EQ(snapshot->sequences[static_cast<std::size_t>(i - 1)].opened.id, fmt::format("s{}", i));
}

TEST_F(SqliteStoreTest, RefusesANewerSchema) {
  Open().reset();
  auto connection = SqliteConnection::Open(path_);
  ASSERT_TRUE(connection->Execute("PRAGMA user_version = 99").ok());
  const auto store = OpenSqliteStore(path_);
  EXPECT_EQ(store.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(store.status().message()), HasSubstr("newer"));
}

TEST_F(SqliteStoreTest, SaysThatAFileIsDamaged) {
  std::ofstream(path_) << std::string(8192, 'x');
  const auto store = OpenSqliteStore(path_);
  EXPECT_EQ(store.status().code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(store.status().message()), HasSubstr("damaged"));
}

TEST_F(SqliteStoreTest, TheLockNamesItsHolderAndEndsWithIt) {
  int ready[2];
  int finish[2];
  ASSERT_EQ(pipe(ready), 0);
  ASSERT_EQ(pipe(finish), 0);
  const pid_t child = fork();
  if (child == 0) {
    const auto lock = StateLock::Take(folder_);
    char byte = lock.ok() ? 'y' : 'n';
    if (write(ready[1], &byte, 1) != 1 || read(finish[0], &byte, 1) != 1) _exit(1);
    _exit(0);
  }
  char byte = 0;
  ASSERT_EQ(read(ready[0], &byte, 1), 1);
  ASSERT_EQ(byte, 'y');
  const auto second = StateLock::Take(folder_);
  EXPECT_EQ(second.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(second.status().message()), HasSubstr(std::to_string(child)));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_TRUE(StateLock::Take(folder_).ok());
}

}  // namespace
}  // namespace vorocast::store
