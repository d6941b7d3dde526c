// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/store/postgres_store.h"

#include <unistd.h>

#include <atomic>
#include <map>
#include <mutex>
#include <random>
#include <utility>

#include <fmt/format.h>

#include "scheduler/store/postgres_batch.h"
#include "scheduler/store/postgres_connection.h"
#include "scheduler/store/postgres_leadership.h"
#include "services/base/check.h"

namespace vorocast::store {
namespace {

constexpr const char* kSequences =
    "SELECT id, session, name, frames_per_second, metres_per_unit, up, closed, (SELECT count(*) FROM frame WHERE frame.sequence = sequence.id) "
    "FROM sequence ORDER BY position";
/// Those of sequences that may still be planned.
constexpr const char* kFramesInUse =
    "SELECT sequence, number, encode(blob, 'hex'), extension, size FROM frame WHERE sequence IN (SELECT id FROM sequence WHERE NOT closed UNION "
    "SELECT sequence FROM job WHERE id NOT IN (SELECT job FROM ended_job)) ORDER BY sequence COLLATE \"C\", number";
constexpr const char* kFramesOfOne = "SELECT sequence, number, encode(blob, 'hex'), extension, size FROM frame WHERE sequence = $1 ORDER BY number";
constexpr const char* kJobs =
    "SELECT id, sequence, user_name, priority, spec, cancelled, ended_job.job IS NOT NULL, submitted, paused, workers_max, deadline, memory_limit, "
    "time_factor, coalesce(ended_job.ended, 0) FROM job LEFT JOIN ended_job ON ended_job.job = job.id ORDER BY position";
constexpr const char* kFailures =
    "SELECT job, task, cause, message FROM failure WHERE job NOT IN (SELECT job FROM ended_job) ORDER BY job COLLATE \"C\", task COLLATE \"C\"";
constexpr const char* kRuns =
    "SELECT encode(key, 'hex'), attempt, worker, failed, interrupted, memory_raised, time_raised, copy_attempt, copy_worker FROM run ORDER BY key";
constexpr const char* kResult =
    "SELECT encode(sha256, 'hex'), size, seconds, cpu_seconds, memory_peak, made_for FROM result WHERE key = decode($1, 'hex')";

/// $1 job, $2 task or empty, $3 to $5 the place after which to begin, $6 how many at most, $7 with logs.
constexpr const char* kAttempts =
    "SELECT a.job, a.ended, a.number, a.task, kind, worker, lasted, outcome, cause, message, cpu_seconds, memory_peak, coalesce(l.log, ''::bytea) "
    "FROM attempt a LEFT JOIN attempt_log l ON $7::int = 1 AND l.job = a.job AND l.ended = a.ended AND l.number = a.number AND l.task = a.task "
    "WHERE a.job = $1 AND ($2 = '' OR a.task = $2) AND (a.ended, a.number, a.task) > ($3::bigint, $4::bigint, $5::text) "
    "ORDER BY a.ended, a.number, a.task LIMIT $6::int";

core::AttemptEnded AttemptOf(const PostgresRows& rows, int row) {
  return {.job = rows.Text(row, 0),
          .task = rows.Text(row, 3),
          .kind = static_cast<tasks::Kind>(rows.Integer(row, 4)),
          .attempt = rows.Integer(row, 2),
          .worker = rows.Text(row, 5),
          .lasted = absl::Microseconds(rows.Integer(row, 6)),
          .ended = absl::FromUnixMicros(rows.Integer(row, 1)),
          .outcome = static_cast<core::AttemptEnded::Outcome>(rows.Integer(row, 7)),
          .cause = static_cast<core::Cause>(rows.Integer(row, 8)),
          .message = rows.Text(row, 9),
          .cpu_seconds = rows.Number(row, 10),
          .memory_peak = rows.Integer(row, 11),
          .log = rows.Bytes(row, 12)};
}

FrameAdded FrameOf(const PostgresRows& rows, int row) {
  return {.sequence = rows.Text(row, 0),
          .number = static_cast<std::int32_t>(rows.Integer(row, 1)),
          .blob = rows.Digest(row, 2),
          .extension = rows.Text(row, 3),
          .size = rows.Integer(row, 4)};
}

class PostgresStore final : public Store {
 public:
  PostgresStore(const std::string& url, const std::string& application)
      : leadership_(url, application), writing_(url, application), reading_(url, application) {}

  absl::StatusOr<std::int64_t> Lead(const std::string& address) override {
    ASSIGN_OR_RETURN(const std::int64_t term, leadership_.Take(address));
    term_ = term;
    return term;
  }
  std::int64_t term() const override { return term_; }
  std::string LeaderAddress() override { return leadership_.LeaderAddress(); }
  absl::Status KeepLeading() override { return leadership_.Keep(); }

  absl::StatusOr<Snapshot> Load() override {
    Snapshot snapshot;
    RETURN_IF_ERROR(LoadSequences(snapshot));
    RETURN_IF_ERROR(LoadJobs(snapshot));
    ASSIGN_OR_RETURN(const PostgresRows runs, writing_.Ask({kRuns, {}}));
    for (int row = 0; row < runs.size(); ++row) {
      snapshot.runs.push_back({.key = runs.Digest(row, 0),
                               .attempt = runs.Integer(row, 1),
                               .worker = runs.Text(row, 2),
                               .tries = {.failed = static_cast<std::int32_t>(runs.Integer(row, 3)),
                                         .interrupted = static_cast<std::int32_t>(runs.Integer(row, 4)),
                                         .memory_raised = static_cast<std::int32_t>(runs.Integer(row, 5)),
                                         .time_raised = static_cast<std::int32_t>(runs.Integer(row, 6))},
                               .copy_attempt = runs.Integer(row, 7),
                               .copy_worker = runs.Text(row, 8)});
    }
    ASSIGN_OR_RETURN(const PostgresRows counter, writing_.Ask({"SELECT value FROM counter WHERE name = 'attempt_next'", {}}));
    if (counter.size() > 0) snapshot.attempt_next = counter.Integer(0, 0);
    return snapshot;
  }

  absl::Status Append(const std::vector<Record>& records) override {
    VOROCAST_CHECK(term_ > 0);
    if (records.empty()) return absl::OkStatus();
    std::vector<PostgresStatement> statements = PostgresBatch(records).Statements();
    statements.insert(statements.begin(), {"SELECT fence($1)", PostgresParameters().Add(term_)});
    return writing_.RunAtOnce(statements);
  }

  absl::StatusOr<std::optional<core::Result>> FindResult(const base::Digest& key) override {
    ASSIGN_OR_RETURN(const PostgresRows rows, Read({kResult, PostgresParameters().Add(key.Hex())}));
    if (rows.size() == 0) return std::nullopt;
    return core::Result{.sha256 = rows.Digest(0, 0),
                        .size = rows.Integer(0, 1),
                        .seconds = rows.Number(0, 2),
                        .cpu_seconds = rows.Number(0, 3),
                        .memory_peak = rows.Integer(0, 4),
                        .made_for = rows.Text(0, 5)};
  }

  absl::StatusOr<std::string> FindJobText(const std::string& job, JobText which) override {
    const char* const sql =
        which == JobText::kSummary ? "SELECT summary FROM ended_job WHERE job = $1" : "SELECT whole FROM ended_job WHERE job = $1";
    ASSIGN_OR_RETURN(const PostgresRows rows, Read({sql, PostgresParameters().Add(job)}));
    if (rows.size() == 0) return absl::NotFoundError(fmt::format("job {} has not ended", job));
    return rows.Bytes(0, 0);
  }

  absl::StatusOr<std::vector<FrameAdded>> LoadFrames(const std::string& sequence) override {
    ASSIGN_OR_RETURN(const PostgresRows rows, Read({kFramesOfOne, PostgresParameters().Add(sequence)}));
    std::vector<FrameAdded> frames;
    for (int row = 0; row < rows.size(); ++row) frames.push_back(FrameOf(rows, row));
    return frames;
  }

  absl::StatusOr<std::vector<core::AttemptEnded>> FindAttempts(const AttemptQuery& query) override {
    const core::AttemptEnded before_all{.ended = absl::InfinitePast()};
    const core::AttemptEnded& after = query.after ? *query.after : before_all;
    PostgresParameters parameters;
    parameters.Add(query.job).Add(query.task).Add(absl::ToUnixMicros(after.ended)).Add(after.attempt).Add(after.task);
    parameters.Add(std::int64_t{query.count_max}).Add(std::int64_t{query.logs ? 1 : 0});
    ASSIGN_OR_RETURN(const PostgresRows rows, Read({kAttempts, std::move(parameters)}));
    std::vector<core::AttemptEnded> attempts;
    for (int row = 0; row < rows.size(); ++row) attempts.push_back(AttemptOf(rows, row));
    return attempts;
  }

 private:
  absl::StatusOr<PostgresRows> Read(const PostgresStatement& statement) {
    const std::lock_guard lock(reading_mutex_);
    const bool was_open = reading_.is_open();
    auto rows = reading_.Ask(statement);
    // A connection that broke while nobody used it shows only now.
    if (was_open && !reading_.is_open()) rows = reading_.Ask(statement);
    return rows;
  }

  absl::Status LoadSequences(Snapshot& snapshot) {
    std::map<std::string, std::size_t> by_id;
    ASSIGN_OR_RETURN(const PostgresRows sequences, writing_.Ask({kSequences, {}}));
    for (int row = 0; row < sequences.size(); ++row) {
      by_id.emplace(sequences.Text(row, 0), snapshot.sequences.size());
      StoredSequence& sequence = snapshot.sequences.emplace_back();
      sequence.opened = {.id = sequences.Text(row, 0),
                         .session = sequences.Text(row, 1),
                         .name = sequences.Text(row, 2),
                         .frames_per_second = sequences.Number(row, 3),
                         .metres_per_unit = sequences.Number(row, 4),
                         .up = sequences.Text(row, 5)};
      sequence.closed = sequences.Truth(row, 6);
      sequence.frame_count = sequences.Integer(row, 7);
      if (!sequence.closed || sequence.frame_count == 0) sequence.frames.emplace();
    }
    ASSIGN_OR_RETURN(const PostgresRows frames, writing_.Ask({kFramesInUse, {}}));
    for (int row = 0; row < frames.size(); ++row) {
      const auto found = by_id.find(frames.Text(row, 0));
      if (found == by_id.end())
        return absl::DataLossError(fmt::format("a frame belongs to sequence {}, which is not on record", frames.Text(row, 0)));
      StoredSequence& sequence = snapshot.sequences[found->second];
      if (!sequence.frames) sequence.frames.emplace();
      sequence.frames->push_back(FrameOf(frames, row));
    }
    return absl::OkStatus();
  }

  absl::Status LoadJobs(Snapshot& snapshot) {
    std::map<std::string, std::size_t> by_id;
    ASSIGN_OR_RETURN(const PostgresRows jobs, writing_.Ask({kJobs, {}}));
    for (int row = 0; row < jobs.size(); ++row) {
      by_id.emplace(jobs.Text(row, 0), snapshot.jobs.size());
      snapshot.jobs.push_back({.added = {.id = jobs.Text(row, 0),
                                         .sequence = jobs.Text(row, 1),
                                         .user = jobs.Text(row, 2),
                                         .priority = static_cast<std::int32_t>(jobs.Integer(row, 3)),
                                         .spec_json = jobs.Text(row, 4),
                                         .terms = {.workers_max = static_cast<std::int32_t>(jobs.Integer(row, 9)),
                                                   .deadline = jobs.Number(row, 10),
                                                   .memory_limit = jobs.Integer(row, 11),
                                                   .time_factor = jobs.Number(row, 12)},
                                         .submitted = jobs.Number(row, 7)},
                               .cancelled = jobs.Truth(row, 5),
                               .paused = jobs.Truth(row, 8),
                               .ended = jobs.Truth(row, 6),
                               .ended_at = jobs.Number(row, 13)});
    }
    ASSIGN_OR_RETURN(const PostgresRows failures, writing_.Ask({kFailures, {}}));
    for (int row = 0; row < failures.size(); ++row) {
      const auto job = by_id.find(failures.Text(row, 0));
      if (job == by_id.end()) return absl::DataLossError(fmt::format("a failure belongs to job {}, which is not on record", failures.Text(row, 0)));
      snapshot.jobs[job->second].failures.push_back({.job = failures.Text(row, 0),
                                                     .task = failures.Text(row, 1),
                                                     .cause = static_cast<core::Cause>(failures.Integer(row, 2)),
                                                     .message = failures.Text(row, 3)});
    }
    return absl::OkStatus();
  }

  PostgresLeadership leadership_;
  std::int64_t term_ = 0;
  PostgresConnection writing_;
  std::mutex reading_mutex_;
  PostgresConnection reading_;  // guarded by reading_mutex_
};

/// One name for all connections of one store, and for no other's: a successor ends them together.
std::string ApplicationName() {
  std::random_device random;
  return fmt::format("vorocast-scheduler-{}-{:08x}{:08x}", getpid(), random(), random());
}

}  // namespace

absl::StatusOr<std::unique_ptr<Store>> OpenPostgresStore(const std::string& url) {
  RETURN_IF_ERROR(CheckPostgresUrl(url));
  return std::make_unique<PostgresStore>(url, ApplicationName());
}

}  // namespace vorocast::store
