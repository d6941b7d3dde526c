// SPDX-License-Identifier: AGPL-3.0-or-later
// What every store must do, held against each of them.
#include "scheduler/store/store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include <fmt/format.h>

#include "scheduler/store/postgres_connection.h"
#include "scheduler/store/postgres_store.h"
#include "scheduler/store/sqlite_connection.h"
#include "scheduler/store/sqlite_store.h"
#include "tests/support/temporary_postgres.h"

namespace vorocast::store {
namespace {

using testing::HasSubstr;

/// A place where stores of one kind can be opened again and again.
class Place {
 public:
  virtual ~Place() = default;
  virtual absl::StatusOr<std::unique_ptr<Store>> Open() = 0;
  /// Takes the leadership away from whoever has it without that one's knowledge, as when it is stopped for long.
  virtual void Depose() = 0;
  /// As a later version of the program would leave it.
  virtual void WriteNewerSchema() = 0;
};

class SqlitePlace final : public Place {
 public:
  explicit SqlitePlace(const std::string& name)
      : folder_(std::filesystem::temp_directory_path() / fmt::format("vorocast_store_{}_{}", name, getpid())) {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  ~SqlitePlace() override { std::filesystem::remove_all(folder_); }
  absl::StatusOr<std::unique_ptr<Store>> Open() override { return OpenSqliteStore(folder_ / "scheduler.db"); }
  void Depose() override { std::filesystem::remove(folder_ / "scheduler.lock"); }
  void WriteNewerSchema() override {
    auto connection = SqliteConnection::Open(folder_ / "scheduler.db");
    ASSERT_TRUE(connection.ok());
    ASSERT_TRUE(connection->Execute("INSERT INTO migration VALUES(99, 'tomorrow'); PRAGMA user_version = 99").ok());
  }

 private:
  std::filesystem::path folder_;
};

/// One server for the whole program, as starting it takes a second.
support::TemporaryPostgres* Server() {
  static const std::unique_ptr<support::TemporaryPostgres> server = support::TemporaryPostgres::Start();
  return server.get();
}

class PostgresPlace final : public Place {
 public:
  explicit PostgresPlace(std::string name) : url_(Server()->Url(std::move(name))) {}
  absl::StatusOr<std::unique_ptr<Store>> Open() override { return OpenPostgresStore(url_); }
  void Depose() override {
    ASSERT_TRUE(PostgresConnection(url_, "test")
                    .Ask({"SELECT pg_terminate_backend(pid) FROM pg_locks WHERE locktype = 'advisory' AND granted "
                          "AND objid::bigint = (hashtext(current_schema())::bigint & 4294967295)",
                          {}})
                    .ok());
  }
  void WriteNewerSchema() override { ASSERT_TRUE(PostgresConnection(url_, "test").Execute("INSERT INTO migration(version) VALUES(99)").ok()); }

 private:
  std::string url_;
};

class StoreTest : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
    name = name.substr(0, name.find('/'));
    if (GetParam() == "Sqlite") {
      place_ = std::make_unique<SqlitePlace>(name);
    } else if (Server()) {
      place_ = std::make_unique<PostgresPlace>(name);
    } else {
      GTEST_SKIP() << "PostgreSQL is not installed: deploy/install_packages.sh";
    }
  }

  std::unique_ptr<Store> Lead(const std::string& address = "here:1") {
    auto store = place_->Open();
    EXPECT_TRUE(store.ok()) << store.status();
    if (!store.ok()) return nullptr;
    const auto term = (*store)->Lead(address);
    EXPECT_TRUE(term.ok()) << term.status();
    return *std::move(store);
  }

  std::unique_ptr<Place> place_;
};
INSTANTIATE_TEST_SUITE_P(Each, StoreTest, testing::Values("Sqlite", "Postgres"), [](const auto& kind) { return kind.param; });

std::vector<Record> Take() {
  return {SequenceOpened{"s1", "monday", "take \"1\" \\ {é}", 29.97, 0.01, "-z"},
          FrameAdded{"s1", 7, base::HashBytes("seven"), ".ply", 70},
          FrameAdded{"s1", 2, base::HashBytes("two"), ".drc", 20},
          SequenceClosed{"s1"},
          JobAdded{"j1",
                   "s1",
                   "anna, \"the\" user",
                   -3,
                   R"({"cells":5})",
                   {.workers_max = 7, .deadline = 1.8e9 + 0.25, .memory_limit = 9'000'000'000, .time_factor = 1.75},
                   1.7e9 + 0.5},
          core::Record(core::TaskFailed{"j1", "frame 2: tessellate", core::Cause::kTimedOut, "too long, {\"by\"} \\far"}),
          core::Record(core::RunSaved{
              base::HashBytes("run"), 12, "worker-1", {.failed = 1, .interrupted = 2, .memory_raised = 1, .time_raised = 3}, 19, "worker \"2\""}),
          core::Record(core::AttemptsReserved{1001}),
          core::Record(core::ResultMade{base::HashBytes("key"), {base::HashBytes("bytes"), 99, 1.5, 0.1, 4096, "j1"}})};
}

void ExpectTake(Store& store) {
  const auto snapshot = store.Load();
  ASSERT_TRUE(snapshot.ok()) << snapshot.status();
  ASSERT_EQ(snapshot->sequences.size(), 1u);
  const StoredSequence& sequence = snapshot->sequences[0];
  EXPECT_EQ(sequence.opened.name, "take \"1\" \\ {é}");
  EXPECT_EQ(sequence.opened.frames_per_second, 29.97);
  EXPECT_EQ(sequence.opened.up, "-z");
  EXPECT_TRUE(sequence.closed);
  EXPECT_EQ(sequence.frame_count, 2);
  ASSERT_TRUE(sequence.frames.has_value());
  ASSERT_EQ(sequence.frames->size(), 2u);
  EXPECT_EQ(sequence.frames->at(0).number, 2);
  EXPECT_EQ(sequence.frames->at(1).blob, base::HashBytes("seven"));
  EXPECT_EQ(sequence.frames->at(1).size, 70);
  ASSERT_EQ(snapshot->jobs.size(), 1u);
  EXPECT_EQ(snapshot->jobs[0].added.priority, -3);
  EXPECT_EQ(snapshot->jobs[0].added.user, "anna, \"the\" user");
  EXPECT_EQ(snapshot->jobs[0].added.spec_json, R"({"cells":5})");
  EXPECT_EQ(snapshot->jobs[0].added.terms.workers_max, 7);
  EXPECT_EQ(snapshot->jobs[0].added.terms.deadline, 1.8e9 + 0.25);
  EXPECT_EQ(snapshot->jobs[0].added.terms.memory_limit, 9'000'000'000);
  EXPECT_EQ(snapshot->jobs[0].added.terms.time_factor, 1.75);
  EXPECT_EQ(snapshot->jobs[0].added.submitted, 1.7e9 + 0.5);
  EXPECT_FALSE(snapshot->jobs[0].cancelled);
  EXPECT_FALSE(snapshot->jobs[0].paused);
  EXPECT_FALSE(snapshot->jobs[0].ended);
  EXPECT_EQ(snapshot->jobs[0].ended_at, 0);
  ASSERT_EQ(snapshot->jobs[0].failures.size(), 1u);
  EXPECT_EQ(snapshot->jobs[0].failures[0].cause, core::Cause::kTimedOut);
  EXPECT_EQ(snapshot->jobs[0].failures[0].message, "too long, {\"by\"} \\far");
  ASSERT_EQ(snapshot->runs.size(), 1u);
  EXPECT_EQ(snapshot->runs[0].key, base::HashBytes("run"));
  EXPECT_EQ(snapshot->runs[0].worker, "worker-1");
  EXPECT_EQ(snapshot->runs[0].attempt, 12);
  EXPECT_EQ(snapshot->runs[0].tries.interrupted, 2);
  EXPECT_EQ(snapshot->runs[0].tries.memory_raised, 1);
  EXPECT_EQ(snapshot->runs[0].tries.time_raised, 3);
  EXPECT_EQ(snapshot->runs[0].copy_attempt, 19);
  EXPECT_EQ(snapshot->runs[0].copy_worker, "worker \"2\"");
  EXPECT_EQ(snapshot->attempt_next, 1001);
  const auto result = store.FindResult(base::HashBytes("key"));
  ASSERT_TRUE(result.ok() && result->has_value()) << result.status();
  EXPECT_EQ((*result)->sha256, base::HashBytes("bytes"));
  EXPECT_EQ((*result)->seconds, 1.5);
  EXPECT_EQ((*result)->cpu_seconds, 0.1);
  EXPECT_EQ((*result)->memory_peak, 4096);
  EXPECT_FALSE(store.FindResult(base::HashBytes("other"))->has_value());
}

TEST_P(StoreTest, RemembersOverAReopening) {
  {
    const auto store = Lead();
    const absl::Status status = store->Append(Take());
    ASSERT_TRUE(status.ok()) << status;
  }
  ExpectTake(*Lead());
}

TEST_P(StoreTest, WritingABatchTwiceIsHarmless) {
  const auto store = Lead();
  ASSERT_TRUE(store->Append(Take()).ok());
  ASSERT_TRUE(store->Append(Take()).ok());
  ExpectTake(*store);
}

TEST_P(StoreTest, LaterRecordsReplaceEarlierOnes) {
  const auto store = Lead();
  ASSERT_TRUE(store->Append(Take()).ok());
  ASSERT_TRUE(store->Append({core::Record(core::JobCancelled{"j1"}), core::Record(core::RunEnded{base::HashBytes("run")})}).ok());
  EXPECT_TRUE(store->Load()->jobs[0].cancelled);
  EXPECT_TRUE(store->Load()->runs.empty());
  ASSERT_TRUE(store->Append({core::Record(core::JobRetried{"j1"})}).ok());
  EXPECT_FALSE(store->Load()->jobs[0].cancelled);
  EXPECT_TRUE(store->Load()->jobs[0].failures.empty());
}

TEST_P(StoreTest, WithinOneBatchTooTheLastRecordHolds) {
  const auto store = Lead();
  const base::Digest run = base::HashBytes("run");
  std::vector<Record> records = Take();
  records.insert(records.end(), {core::Record(core::JobRetried{"j1"}), core::Record(core::TaskFailed{"j1", "guide", core::Cause::kCrashed, "once"}),
                                 core::Record(core::TaskFailed{"j1", "guide", core::Cause::kInput, "twice"}), core::Record(core::JobCancelled{"j1"}),
                                 core::Record(core::RunEnded{run}), core::Record(core::RunSaved{run, 13, "worker-2", {}}),
                                 core::Record(core::RunSaved{base::HashBytes("other"), 14, "worker-2", {}}),
                                 core::Record(core::RunEnded{base::HashBytes("other")}), core::Record(core::AttemptsReserved{2001})});
  const absl::Status status = store->Append(records);
  ASSERT_TRUE(status.ok()) << status;
  const auto snapshot = store->Load();
  ASSERT_EQ(snapshot->jobs[0].failures.size(), 1u);
  EXPECT_EQ(snapshot->jobs[0].failures[0].message, "twice");
  EXPECT_TRUE(snapshot->jobs[0].cancelled);
  ASSERT_EQ(snapshot->runs.size(), 1u);
  EXPECT_EQ(snapshot->runs[0].attempt, 13);
  EXPECT_EQ(snapshot->attempt_next, 2001);
}

TEST_P(StoreTest, APauseAndNewLimitsLastOverAReopening) {
  {
    const auto store = Lead();
    ASSERT_TRUE(store->Append(Take()).ok());
    // Within one batch too the last one holds.
    const absl::Status status =
        store->Append({core::Record(core::JobPaused{"j1", false}), core::Record(core::JobPaused{"j1", true}),
                       core::Record(core::JobLimited{"j1", 1, 1}), core::Record(core::JobLimited{"j1", 12'000'000'000, 2.5})});
    ASSERT_TRUE(status.ok()) << status;
  }
  const auto store = Lead();
  const auto snapshot = store->Load();
  EXPECT_TRUE(snapshot->jobs[0].paused);
  EXPECT_EQ(snapshot->jobs[0].added.terms.memory_limit, 12'000'000'000);
  EXPECT_EQ(snapshot->jobs[0].added.terms.time_factor, 2.5);
  EXPECT_EQ(snapshot->jobs[0].added.terms.workers_max, 7);
  ASSERT_TRUE(store->Append({core::Record(core::JobRetried{"j1"})}).ok());
  EXPECT_TRUE(store->Load()->jobs[0].paused) << "a retry resumes nothing";
  EXPECT_EQ(store->Load()->jobs[0].added.terms.time_factor, 2.5);
  ASSERT_TRUE(store->Append({core::Record(core::JobPaused{"j1", false})}).ok());
  EXPECT_FALSE(store->Load()->jobs[0].paused);
}

TEST_P(StoreTest, KeepsTheOrderOfSubmission) {
  const auto store = Lead();
  std::vector<Record> records;
  for (int i = 1; i <= 12; ++i) {
    records.push_back(SequenceOpened{fmt::format("s{}", i), "s", fmt::format("n{}", i), 25, 1, "+y"});
    records.push_back(JobAdded{fmt::format("j{}", i), fmt::format("s{}", i), "anna", 0, "{}"});
  }
  ASSERT_TRUE(store->Append(records).ok());
  const auto snapshot = store->Load();
  for (int i = 1; i <= 12; ++i) {
    EXPECT_EQ(snapshot->sequences[static_cast<std::size_t>(i - 1)].opened.id, fmt::format("s{}", i));
    EXPECT_EQ(snapshot->jobs[static_cast<std::size_t>(i - 1)].added.id, fmt::format("j{}", i));
  }
}

TEST_P(StoreTest, AnEndedJobIsKeptAsItWasShown) {
  const auto store = Lead();
  const std::string whole("bytes\0with \"all\" \xff of them", 25);
  ASSERT_TRUE(store->Append(Take()).ok());
  EXPECT_EQ(store->FindJobText("j1", JobText::kWhole).status().code(), absl::StatusCode::kNotFound);
  ASSERT_TRUE(store->Append({JobEnded{"j1", "short", whole, 1.7e9 + 99.5}}).ok());
  EXPECT_EQ(*store->FindJobText("j1", JobText::kSummary), "short");
  EXPECT_EQ(*store->FindJobText("j1", JobText::kWhole), whole);
  const auto snapshot = store->Load();
  EXPECT_TRUE(snapshot->jobs[0].ended);
  EXPECT_EQ(snapshot->jobs[0].ended_at, 1.7e9 + 99.5);
  EXPECT_TRUE(snapshot->jobs[0].failures.empty());
  // Nobody needs the frames for planning any more.
  EXPECT_FALSE(snapshot->sequences[0].frames.has_value());
  EXPECT_EQ(snapshot->sequences[0].frame_count, 2);
  ASSERT_EQ(store->LoadFrames("s1")->size(), 2u);
  EXPECT_EQ(store->LoadFrames("s1")->at(0).blob, base::HashBytes("two"));
  ASSERT_TRUE(store->Append({core::Record(core::JobRetried{"j1"})}).ok());
  EXPECT_FALSE(store->Load()->jobs[0].ended);
  EXPECT_EQ(store->Load()->jobs[0].ended_at, 0);
  EXPECT_TRUE(store->Load()->sequences[0].frames.has_value());
}

TEST_P(StoreTest, OneLeadsAtATime) {
  auto first = Lead("first:1");
  auto second = *place_->Open();
  const auto refused = second->Lead("second:1");
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(refused.status().message()), HasSubstr("another scheduler"));
  EXPECT_TRUE(first->KeepLeading().ok());
  ASSERT_TRUE(first->Append(Take()).ok());
  first.reset();
  const auto term = second->Lead("second:1");
  ASSERT_TRUE(term.ok()) << term.status();
  EXPECT_EQ(*term, 2);
  ExpectTake(*second);
}

TEST_P(StoreTest, ADeposedLeadersWritesAreRefused) {
  const auto first = Lead();
  ASSERT_TRUE(first->Append(Take()).ok());
  place_->Depose();
  const auto second = Lead();
  ASSERT_TRUE(second->Append({core::Record(core::JobCancelled{"j1"})}).ok());
  const absl::Status refused = first->Append({core::Record(core::JobRetried{"j1"}), core::Record(core::AttemptsReserved{9})});
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition) << refused;
  EXPECT_THAT(std::string(refused.message()), HasSubstr("term 2; this one's was 1"));
  EXPECT_EQ(first->KeepLeading().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_TRUE(second->KeepLeading().ok());
  EXPECT_TRUE(second->Load()->jobs[0].cancelled);
  EXPECT_EQ(second->Load()->attempt_next, 1001);
}

TEST_P(StoreTest, RefusesANewerSchema) {
  Lead().reset();
  place_->WriteNewerSchema();
  const auto term = (*place_->Open())->Lead("");
  EXPECT_EQ(term.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(term.status().message()), HasSubstr("newer"));
}

TEST(PostgresStore, GoesOnWhenTheServerIsBack) {
  if (!Server()) GTEST_SKIP() << "PostgreSQL is not installed: deploy/install_packages.sh";
  const auto store = *OpenPostgresStore(Server()->Url("restart"));
  ASSERT_TRUE(store->Lead("here:1").ok());
  ASSERT_TRUE(store->Append(Take()).ok());
  Server()->Kill();
  EXPECT_EQ(store->Append({core::Record(core::JobCancelled{"j1"})}).code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(store->KeepLeading().code(), absl::StatusCode::kUnavailable);
  Server()->Restart();
  const absl::Status status = store->Append({core::Record(core::JobRetried{"j9"})});
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_TRUE(store->KeepLeading().ok());
  ExpectTake(*store);
  // It has the lock again, not only the term.
  EXPECT_FALSE((*OpenPostgresStore(Server()->Url("restart")))->Lead("there:1").ok());
}

TEST(PostgresStore, NamesTheLeaderAndTakesNoPasswordInTheUrl) {
  if (!Server()) GTEST_SKIP() << "PostgreSQL is not installed: deploy/install_packages.sh";
  const auto leader = *OpenPostgresStore(Server()->Url("named"));
  ASSERT_TRUE(leader->Lead("stage:4000").ok());
  const auto other = *OpenPostgresStore(Server()->Url("named"));
  EXPECT_THAT(std::string(other->Lead("x").status().message()), HasSubstr("stage:4000"));
  EXPECT_EQ(other->LeaderAddress(), "stage:4000");
  const auto secret = OpenPostgresStore("postgresql://anna:hunter2@host/farm");
  EXPECT_EQ(secret.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(secret.status().message()), testing::AllOf(HasSubstr(".pgpass"), testing::Not(HasSubstr("hunter2"))));
}

core::AttemptEnded Attempt(const std::string& job, std::int64_t number, const std::string& task, int second) {
  return {.job = job,
          .task = task,
          .kind = tasks::Kind::kTrack,
          .attempt = number,
          .worker = "worker \"7\", {é}",
          .lasted = absl::Milliseconds(1500),
          .ended = absl::FromUnixSeconds(1'800'000'000 + second),
          .outcome = core::AttemptEnded::Outcome::kFailed,
          .cause = core::Cause::kCrashed,
          .message = "killed by {\"SIGSEGV\"} \\",
          .cpu_seconds = 0.75,
          .memory_peak = std::int64_t{5} << 30,
          .log = "last words\n\"{}\\ é"};
}
std::vector<std::int64_t> Numbers(Store& store, const AttemptQuery& query) {
  const auto attempts = store.FindAttempts(query);
  EXPECT_TRUE(attempts.ok()) << attempts.status();
  std::vector<std::int64_t> numbers;
  if (attempts.ok())
    for (const core::AttemptEnded& attempt : *attempts) numbers.push_back(attempt.attempt);
  return numbers;
}

TEST_P(StoreTest, KeepsEachAttemptWithWhatItPrinted) {
  core::AttemptEnded attempt = Attempt("j1", 12, "frame 2: tessellate", 3);
  attempt.log += std::string("\0\xff", 2);
  {
    const auto store = Lead();
    for (int twice = 0; twice < 2; ++twice) {
      const absl::Status status = store->Append({core::Record(attempt)});
      ASSERT_TRUE(status.ok()) << status;
    }
  }
  const auto store = Lead();
  const auto found = store->FindAttempts({.job = "j1", .logs = true});
  ASSERT_TRUE(found.ok()) << found.status();
  ASSERT_EQ(found->size(), 1u);
  const core::AttemptEnded& kept = found->front();
  EXPECT_EQ(kept.job, "j1");
  EXPECT_EQ(kept.task, "frame 2: tessellate");
  EXPECT_EQ(kept.kind, tasks::Kind::kTrack);
  EXPECT_EQ(kept.attempt, 12);
  EXPECT_EQ(kept.worker, attempt.worker);
  EXPECT_EQ(kept.lasted, absl::Milliseconds(1500));
  EXPECT_EQ(kept.ended, attempt.ended);
  EXPECT_EQ(kept.outcome, core::AttemptEnded::Outcome::kFailed);
  EXPECT_EQ(kept.cause, core::Cause::kCrashed);
  EXPECT_EQ(kept.message, attempt.message);
  EXPECT_EQ(kept.cpu_seconds, 0.75);
  EXPECT_EQ(kept.memory_peak, std::int64_t{5} << 30);
  EXPECT_EQ(kept.log, attempt.log);
  EXPECT_EQ(store->FindAttempts({.job = "j1"})->front().log, "");
}

TEST_P(StoreTest, GivesAttemptsInTheOrderTheyEndedPortionByPortion) {
  const auto store = Lead();
  // One attempt that two tasks of a job waited for, and others' attempts among them.
  ASSERT_TRUE(store
                  ->Append({core::Record(Attempt("j1", 5, "b", 9)), core::Record(Attempt("j1", 9, "a", 2)), core::Record(Attempt("j2", 4, "a", 4)),
                            core::Record(Attempt("j1", 7, "b", 5)), core::Record(Attempt("j1", 7, "a", 5)), core::Record(Attempt("j1", 6, "c", 5))})
                  .ok());
  EXPECT_THAT(Numbers(*store, {.job = "j1"}), testing::ElementsAre(9, 6, 7, 7, 5));
  EXPECT_THAT(Numbers(*store, {.job = "j1", .task = "b"}), testing::ElementsAre(7, 5));
  EXPECT_THAT(Numbers(*store, {.job = "j3"}), testing::ElementsAre());
  std::vector<std::int64_t> together;
  AttemptQuery query{.job = "j1", .logs = true, .count_max = 2};
  for (int portion = 0; portion < 4; ++portion) {
    const auto attempts = store->FindAttempts(query);
    ASSERT_TRUE(attempts.ok()) << attempts.status();
    for (const core::AttemptEnded& attempt : *attempts) together.push_back(attempt.attempt);
    if (!attempts->empty()) query.after = attempts->back();
  }
  EXPECT_THAT(together, testing::ElementsAre(9, 6, 7, 7, 5));
}

TEST_P(StoreTest, ForgetsOldAttemptsOfEndedJobsOnly) {
  const auto store = Lead();
  ASSERT_TRUE(store->Append(Take()).ok());
  ASSERT_TRUE(store
                  ->Append({JobAdded{"j2", "s1", "anna", 0, "{}"}, JobEnded{"j1", "s", "w"}, core::Record(Attempt("j1", 1, "a", 1)),
                            core::Record(Attempt("j1", 2, "a", 2)), core::Record(Attempt("j1", 3, "a", 3)), core::Record(Attempt("j2", 4, "a", 1))})
                  .ok());
  const absl::Time before = absl::FromUnixSeconds(1'800'000'003);
  const absl::Status status = store->Append({AttemptsForgotten{before, 1}});
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_THAT(Numbers(*store, {.job = "j1"}), testing::ElementsAre(2, 3));
  ASSERT_TRUE(store->Append({AttemptsForgotten{before, 10}}).ok());
  EXPECT_THAT(Numbers(*store, {.job = "j1"}), testing::ElementsAre(3));
  EXPECT_THAT(Numbers(*store, {.job = "j2"}), testing::ElementsAre(4));
  EXPECT_EQ(store->FindAttempts({.job = "j1", .logs = true})->front().log, Attempt("j1", 3, "a", 3).log);
}

}  // namespace
}  // namespace vorocast::store
