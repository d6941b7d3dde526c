// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/store/sqlite_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
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

  std::unique_ptr<Store> Lead() {
    auto store = OpenSqliteStore(path_);
    EXPECT_TRUE(store.ok()) << store.status();
    const auto term = (*store)->Lead("");
    EXPECT_TRUE(term.ok()) << term.status();
    return *std::move(store);
  }

  static std::vector<Record> Take() { return {SequenceOpened{"s1", "monday", "take", 25, 1, "+y"}, JobAdded{"j1", "s1", "anna", 0, "{}"}}; }

  std::filesystem::path folder_;
  std::filesystem::path path_;
};

TEST_F(SqliteStoreTest, EachCommitSurvivesAKill) {
  // What a kill leaves is the files as they are on disk at that moment.
  const auto store = Lead();
  ASSERT_TRUE(store->Append(Take()).ok());
  const std::filesystem::path killed = folder_ / "killed";
  std::filesystem::create_directories(killed);
  for (const char* file : {"scheduler.db", "scheduler.db-wal"}) std::filesystem::copy_file(folder_ / file, killed / file);
  ASSERT_TRUE(store->Append({core::Record(core::JobCancelled{"j1"})}).ok());
  path_ = killed / "scheduler.db";
  const auto snapshot = Lead()->Load();
  ASSERT_EQ(snapshot->jobs.size(), 1u);
  EXPECT_FALSE(snapshot->jobs[0].cancelled);
}

TEST_F(SqliteStoreTest, TakesOverADatabaseFromBeforeTerms) {
  Lead()->Append(Take()).IgnoreError();
  auto connection = SqliteConnection::Open(path_);
  ASSERT_TRUE(connection->Execute("DROP TABLE attempt; DROP TABLE attempt_log").ok());
  ASSERT_TRUE(connection->Execute("DROP TABLE ended_job; DROP TABLE migration; DELETE FROM meta WHERE name = 'term'; PRAGMA user_version = 1").ok());
  for (const char* column : {"submitted", "paused", "workers_max", "deadline", "memory_limit", "time_factor"}) {
    ASSERT_TRUE(connection->Execute(fmt::format("ALTER TABLE job DROP COLUMN {}", column)).ok());
  }
  for (const char* column : {"time_raised", "copy_attempt", "copy_worker"}) {
    ASSERT_TRUE(connection->Execute(fmt::format("ALTER TABLE run DROP COLUMN {}", column)).ok());
  }
  const auto store = Lead();
  ASSERT_EQ(store->Load()->jobs.size(), 1u);
  EXPECT_EQ(store->Load()->jobs[0].added.submitted, 0);
  EXPECT_EQ(store->Load()->jobs[0].added.terms.time_factor, 1);
  EXPECT_TRUE(store->Append({core::Record(core::JobCancelled{"j1"})}).ok());
}

TEST_F(SqliteStoreTest, SaysThatTheDiskIsFullAndGoesOnWhenItIsNot) {
  const auto store = Lead();
  ASSERT_TRUE(store->Append(Take()).ok());
  // A file system that is full, as far as this process can tell.
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto on_signal = signal(SIGXFSZ, SIG_IGN);
  const rlimit full{std::filesystem::file_size(folder_ / "scheduler.db-wal"), before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &full);
  const absl::Status refused = store->Append({core::Record(core::JobCancelled{"j1"})});
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, on_signal);
  EXPECT_FALSE(refused.ok());
  EXPECT_TRUE(store->Append({core::Record(core::JobCancelled{"j1"})}).ok());
  EXPECT_TRUE(store->Load()->jobs[0].cancelled);
}

TEST_F(SqliteStoreTest, SaysThatAFileIsDamaged) {
  std::ofstream(path_) << std::string(8192, 'x');
  const auto term = (*OpenSqliteStore(path_))->Lead("");
  EXPECT_EQ(term.status().code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(term.status().message()), HasSubstr("damaged"));
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
