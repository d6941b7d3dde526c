// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/store/sqlite_store.h"

#include <map>
#include <mutex>
#include <set>
#include <unordered_map>

#include <fmt/format.h>

#include "scheduler/store/sqlite_connection.h"
#include "scheduler/store/sqlite_schema.h"
#include "scheduler/store/state_lock.h"
#include "services/base/check.h"

namespace vorocast::store {
namespace {

// The logs go with the same attempts, and before them.
constexpr const char* kForgetLogs =
    "DELETE FROM attempt_log WHERE (job, ended, number, task) IN (SELECT job, ended, number, task FROM attempt "
    "WHERE job IN (SELECT job FROM ended_job) AND ended < ? ORDER BY job, ended, number, task LIMIT ?)";
constexpr const char* kForgetAttempts =
    "DELETE FROM attempt WHERE (job, ended, number, task) IN (SELECT job, ended, number, task FROM attempt "
    "WHERE job IN (SELECT job FROM ended_job) AND ended < ? ORDER BY job, ended, number, task LIMIT ?)";

/// Writes one record; statements are prepared once.
class RecordWriter {
 public:
  explicit RecordWriter(SqliteConnection& connection) : connection_(connection) {}

  absl::Status operator()(const SequenceOpened& r) {
    return Write("INSERT OR IGNORE INTO sequence(id, session, name, frames_per_second, metres_per_unit, up) VALUES(?,?,?,?,?,?)", r.id, r.session,
                 r.name, r.frames_per_second, r.metres_per_unit, r.up);
  }
  absl::Status operator()(const FrameAdded& r) {
    return Write("INSERT OR REPLACE INTO frame VALUES(?,?,?,?,?)", r.sequence, r.number, r.blob, r.extension, r.size);
  }
  absl::Status operator()(const SequenceClosed& r) { return Write("UPDATE sequence SET closed = 1 WHERE id = ?", r.sequence); }
  absl::Status operator()(const JobAdded& r) {
    return Write(
        "INSERT OR IGNORE INTO job(id, sequence, user, priority, spec, submitted, workers_max, deadline, memory_limit, time_factor) "
        "VALUES(?,?,?,?,?,?,?,?,?,?)",
        r.id, r.sequence, r.user, r.priority, r.spec_json, r.submitted, r.terms.workers_max, r.terms.deadline, r.terms.memory_limit,
        r.terms.time_factor);
  }
  absl::Status operator()(const JobEnded& r) {
    return Write("INSERT OR REPLACE INTO ended_job(job, summary, whole, ended) VALUES(?,?,?,?)", r.job, Bytes{r.summary}, Bytes{r.whole}, r.ended);
  }
  absl::Status operator()(const AttemptsForgotten& r) {
    RETURN_IF_ERROR(Write(kForgetLogs, absl::ToUnixMicros(r.before), r.count_max));
    return Write(kForgetAttempts, absl::ToUnixMicros(r.before), r.count_max);
  }
  absl::Status operator()(const core::Record& record) { return std::visit(*this, record); }
  absl::Status operator()(const core::ResultMade& r) {
    return Write("INSERT OR REPLACE INTO result VALUES(?,?,?,?,?,?,?)", r.key, r.result.sha256, r.result.size, r.result.seconds, r.result.cpu_seconds,
                 r.result.memory_peak, r.result.made_for);
  }
  absl::Status operator()(const core::TaskFailed& r) {
    return Write("INSERT OR REPLACE INTO failure VALUES(?,?,?,?)", r.job, r.task, static_cast<std::int32_t>(r.cause), r.message);
  }
  absl::Status operator()(const core::RunSaved& r) {
    return Write(
        "INSERT OR REPLACE INTO run(key, attempt, worker, failed, interrupted, memory_raised, time_raised, copy_attempt, copy_worker) "
        "VALUES(?,?,?,?,?,?,?,?,?)",
        r.key, r.attempt, r.worker, r.tries.failed, r.tries.interrupted, r.tries.memory_raised, r.tries.time_raised, r.copy_attempt, r.copy_worker);
  }
  absl::Status operator()(const core::RunEnded& r) { return Write("DELETE FROM run WHERE key = ?", r.key); }
  absl::Status operator()(const core::AttemptsReserved& r) { return Write("INSERT OR REPLACE INTO meta VALUES('attempt_next', ?)", r.next); }
  absl::Status operator()(const core::JobCancelled& r) { return Write("UPDATE job SET cancelled = 1 WHERE id = ?", r.job); }
  absl::Status operator()(const core::AttemptEnded& r) {
    const std::int64_t ended = absl::ToUnixMicros(r.ended);
    RETURN_IF_ERROR(Write("INSERT OR IGNORE INTO attempt VALUES(?,?,?,?,?,?,?,?,?,?,?,?)", r.job, ended, r.attempt, r.task,
                          static_cast<std::int32_t>(r.kind), r.worker, absl::ToInt64Microseconds(r.lasted), static_cast<std::int32_t>(r.outcome),
                          static_cast<std::int32_t>(r.cause), r.message, r.cpu_seconds, r.memory_peak));
    if (r.log.empty()) return absl::OkStatus();
    return Write("INSERT OR IGNORE INTO attempt_log VALUES(?,?,?,?,?)", r.job, ended, r.attempt, r.task, Bytes{r.log});
  }
  absl::Status operator()(const core::JobRetried& r) {
    RETURN_IF_ERROR(Write("UPDATE job SET cancelled = 0 WHERE id = ?", r.job));
    RETURN_IF_ERROR(Write("DELETE FROM ended_job WHERE job = ?", r.job));
    return Write("DELETE FROM failure WHERE job = ?", r.job);
  }
  absl::Status operator()(const core::JobPaused& r) {
    return Write("UPDATE job SET paused = ? WHERE id = ?", static_cast<std::int32_t>(r.paused), r.job);
  }
  absl::Status operator()(const core::JobLimited& r) {
    return Write("UPDATE job SET memory_limit = ?, time_factor = ? WHERE id = ?", r.memory_limit, r.time_factor, r.job);
  }

 private:
  /// Told apart from text.
  struct Bytes {
    const std::string& bytes;
  };
  template <typename Value>
  static void Bind(SqliteStatement& statement, const Value& value) {
    statement.Bind(value);
  }
  static void Bind(SqliteStatement& statement, const Bytes& value) { statement.BindBlob(value.bytes); }

  template <typename... Values>
  absl::Status Write(const char* sql, const Values&... values) {
    auto found = statements_.find(sql);
    if (found == statements_.end()) {
      ASSIGN_OR_RETURN(SqliteStatement prepared, SqliteStatement::Prepare(connection_, sql));
      found = statements_.emplace(sql, std::move(prepared)).first;
    }
    (Bind(found->second, values), ...);
    return found->second.Run();
  }

  SqliteConnection& connection_;
  std::unordered_map<const char*, SqliteStatement> statements_;  // by the literal's address
};

/// Calls `row` for each row of a query.
template <typename Row>
absl::Status ForEachRow(SqliteStatement& statement, const Row& row) {
  while (true) {
    ASSIGN_OR_RETURN(const bool more, statement.Next());
    if (!more) return absl::OkStatus();
    RETURN_IF_ERROR(row(statement));
  }
}
template <typename Row>
absl::Status ForEachRow(SqliteConnection& connection, std::string_view sql, const Row& row) {
  ASSIGN_OR_RETURN(SqliteStatement statement, SqliteStatement::Prepare(connection, sql));
  return ForEachRow(statement, row);
}

constexpr std::string_view kSequences =
    "SELECT id, session, name, frames_per_second, metres_per_unit, up, closed, "
    "(SELECT count(*) FROM frame WHERE sequence = id) FROM sequence ORDER BY position";
/// Those of sequences that may still be planned.
constexpr std::string_view kFramesInUse =
    "SELECT sequence, number, blob, extension, size FROM frame WHERE sequence IN (SELECT id FROM sequence WHERE NOT closed UNION "
    "SELECT sequence FROM job WHERE id NOT IN (SELECT job FROM ended_job)) ORDER BY sequence, number";
constexpr std::string_view kFramesOfOne = "SELECT sequence, number, blob, extension, size FROM frame WHERE sequence = ? ORDER BY number";
constexpr std::string_view kJobs =
    "SELECT id, sequence, user, priority, spec, cancelled, ended_job.job IS NOT NULL, submitted, paused, workers_max, deadline, memory_limit, "
    "time_factor, coalesce(ended_job.ended, 0) FROM job LEFT JOIN ended_job ON ended_job.job = job.id ORDER BY position";
constexpr std::string_view kFailures =
    "SELECT job, task, cause, message FROM failure WHERE job NOT IN (SELECT job FROM ended_job) ORDER BY job, task";
constexpr std::string_view kRuns =
    "SELECT key, attempt, worker, failed, interrupted, memory_raised, time_raised, copy_attempt, copy_worker FROM run ORDER BY key";
constexpr std::string_view kResult = "SELECT sha256, size, seconds, cpu_seconds, memory_peak, made_for FROM result WHERE key = ?";

/// ?1 job, ?2 task or empty, ?3 to ?5 the place after which to begin, ?6 how many at most, ?7 with logs.
constexpr std::string_view kAttempts =
    "SELECT a.job, a.ended, a.number, a.task, kind, worker, lasted, outcome, cause, message, cpu_seconds, memory_peak, coalesce(l.log, x'') "
    "FROM attempt a LEFT JOIN attempt_log l ON ?7 AND l.job = a.job AND l.ended = a.ended AND l.number = a.number AND l.task = a.task "
    "WHERE a.job = ?1 AND (?2 = '' OR a.task = ?2) AND (a.ended, a.number, a.task) > (?3, ?4, ?5) ORDER BY a.ended, a.number, a.task LIMIT ?6";

core::AttemptEnded AttemptOf(const SqliteStatement& row) {
  return {.job = row.Text(0),
          .task = row.Text(3),
          .kind = static_cast<tasks::Kind>(row.Integer(4)),
          .attempt = row.Integer(2),
          .worker = row.Text(5),
          .lasted = absl::Microseconds(row.Integer(6)),
          .ended = absl::FromUnixMicros(row.Integer(1)),
          .outcome = static_cast<core::AttemptEnded::Outcome>(row.Integer(7)),
          .cause = static_cast<core::Cause>(row.Integer(8)),
          .message = row.Text(9),
          .cpu_seconds = row.Number(10),
          .memory_peak = row.Integer(11),
          .log = row.Blob(12)};
}

FrameAdded FrameOf(const SqliteStatement& row) {
  return {.sequence = row.Text(0),
          .number = static_cast<std::int32_t>(row.Integer(1)),
          .blob = row.Digest(2),
          .extension = row.Text(3),
          .size = row.Integer(4)};
}

class SqliteStore final : public Store {
 public:
  SqliteStore(std::filesystem::path path, SqliteConnection writing, SqliteConnection reading)
      : path_(std::move(path)), writing_(std::move(writing)), reading_(std::move(reading)) {}

  absl::StatusOr<std::int64_t> Lead(const std::string&) override {
    ASSIGN_OR_RETURN(lock_, StateLock::Take(path_.parent_path()));
    RETURN_IF_ERROR(PrepareSqlite(writing_));
    RETURN_IF_ERROR(InTransaction([this] { return writing_.Execute("UPDATE meta SET value = value + 1 WHERE name = 'term'"); }));
    ASSIGN_OR_RETURN(term_, NewestTerm());
    return term_;
  }

  std::int64_t term() const override { return term_; }
  /// Whoever is refused the lock is on the same machine and finds the address in the state folder.
  std::string LeaderAddress() override { return {}; }

  absl::Status KeepLeading() override {
    const std::lock_guard lock(reading_mutex_);
    std::int64_t newest = 0;
    RETURN_IF_ERROR(ForEachRow(reading_, "SELECT value FROM meta WHERE name = 'term'", [&](const SqliteStatement& row) {
      newest = row.Integer(0);
      return absl::OkStatus();
    }));
    return CheckTerm(newest);
  }

  absl::StatusOr<Snapshot> Load() override {
    Snapshot snapshot;
    RETURN_IF_ERROR(LoadSequences(snapshot));
    RETURN_IF_ERROR(LoadJobs(snapshot));
    RETURN_IF_ERROR(ForEachRow(writing_, kRuns, [&](const SqliteStatement& row) {
      snapshot.runs.push_back({.key = row.Digest(0),
                               .attempt = row.Integer(1),
                               .worker = row.Text(2),
                               .tries = {.failed = static_cast<std::int32_t>(row.Integer(3)),
                                         .interrupted = static_cast<std::int32_t>(row.Integer(4)),
                                         .memory_raised = static_cast<std::int32_t>(row.Integer(5)),
                                         .time_raised = static_cast<std::int32_t>(row.Integer(6))},
                               .copy_attempt = row.Integer(7),
                               .copy_worker = row.Text(8)});
      return absl::OkStatus();
    }));
    RETURN_IF_ERROR(ForEachRow(writing_, "SELECT value FROM meta WHERE name = 'attempt_next'", [&](const SqliteStatement& row) {
      snapshot.attempt_next = row.Integer(0);
      return absl::OkStatus();
    }));
    return snapshot;
  }

  absl::Status Append(const std::vector<Record>& records) override {
    VOROCAST_CHECK(term_ > 0);
    if (records.empty()) return absl::OkStatus();
    return InTransaction([&]() -> absl::Status {
      ASSIGN_OR_RETURN(const std::int64_t newest, NewestTerm());
      RETURN_IF_ERROR(CheckTerm(newest));
      for (const Record& record : records) RETURN_IF_ERROR(std::visit(writer_, record));
      return absl::OkStatus();
    });
  }

  absl::StatusOr<std::optional<core::Result>> FindResult(const base::Digest& key) override {
    const std::lock_guard lock(reading_mutex_);
    if (!find_result_) {
      ASSIGN_OR_RETURN(SqliteStatement prepared, SqliteStatement::Prepare(reading_, kResult));
      find_result_.emplace(std::move(prepared));
    }
    std::optional<core::Result> result;
    find_result_->Bind(key);
    const absl::Status status = ForEachRow(*find_result_, [&](const SqliteStatement& row) {
      result = core::Result{.sha256 = row.Digest(0),
                            .size = row.Integer(1),
                            .seconds = row.Number(2),
                            .cpu_seconds = row.Number(3),
                            .memory_peak = row.Integer(4),
                            .made_for = row.Text(5)};
      return absl::OkStatus();
    });
    find_result_->Reset();
    RETURN_IF_ERROR(status);
    return result;
  }

  absl::StatusOr<std::string> FindJobText(const std::string& job, JobText which) override {
    const std::lock_guard lock(reading_mutex_);
    ASSIGN_OR_RETURN(SqliteStatement statement, SqliteStatement::Prepare(reading_, fmt::format("SELECT {} FROM ended_job WHERE job = ?",
                                                                                               which == JobText::kSummary ? "summary" : "whole")));
    statement.Bind(job);
    ASSIGN_OR_RETURN(const bool found, statement.Next());
    if (!found) return absl::NotFoundError(fmt::format("{}: job {} has not ended", path_.string(), job));
    return statement.Blob(0);
  }

  absl::StatusOr<std::vector<FrameAdded>> LoadFrames(const std::string& sequence) override {
    const std::lock_guard lock(reading_mutex_);
    ASSIGN_OR_RETURN(SqliteStatement statement, SqliteStatement::Prepare(reading_, kFramesOfOne));
    statement.Bind(sequence);
    std::vector<FrameAdded> frames;
    RETURN_IF_ERROR(ForEachRow(statement, [&](const SqliteStatement& row) {
      frames.push_back(FrameOf(row));
      return absl::OkStatus();
    }));
    return frames;
  }

  absl::StatusOr<std::vector<core::AttemptEnded>> FindAttempts(const AttemptQuery& query) override {
    const std::lock_guard lock(reading_mutex_);
    ASSIGN_OR_RETURN(SqliteStatement statement, SqliteStatement::Prepare(reading_, kAttempts));
    const core::AttemptEnded before_all{.ended = absl::InfinitePast()};
    const core::AttemptEnded& after = query.after ? *query.after : before_all;
    statement.Bind(query.job).Bind(query.task).Bind(absl::ToUnixMicros(after.ended)).Bind(after.attempt).Bind(after.task);
    statement.Bind(query.count_max).Bind(query.logs ? 1 : 0);
    std::vector<core::AttemptEnded> attempts;
    RETURN_IF_ERROR(ForEachRow(statement, [&](const SqliteStatement& row) {
      attempts.push_back(AttemptOf(row));
      return absl::OkStatus();
    }));
    return attempts;
  }

 private:
  template <typename Work>
  absl::Status InTransaction(const Work& work) {
    RETURN_IF_ERROR(writing_.Execute("BEGIN IMMEDIATE"));
    absl::Status status = work();
    if (status.ok()) status = writing_.Execute("COMMIT");
    if (!status.ok() && sqlite3_get_autocommit(writing_.get()) == 0) (void)writing_.Execute("ROLLBACK");
    return status;
  }

  absl::StatusOr<std::int64_t> NewestTerm() {
    if (!newest_term_) {
      ASSIGN_OR_RETURN(SqliteStatement prepared, SqliteStatement::Prepare(writing_, "SELECT value FROM meta WHERE name = 'term'"));
      newest_term_.emplace(std::move(prepared));
    }
    const absl::StatusOr<bool> found = newest_term_->Next();
    const std::int64_t term = found.ok() && *found ? newest_term_->Integer(0) : 0;
    newest_term_->Reset();
    RETURN_IF_ERROR(found.status());
    return term;
  }

  absl::Status CheckTerm(std::int64_t newest) const {
    if (newest == term_) return absl::OkStatus();
    return absl::FailedPreconditionError(fmt::format(
        "{}: another scheduler leads under term {}; this one's was {}, and nothing more of it is written", path_.string(), newest, term_));
  }

  absl::Status LoadSequences(Snapshot& snapshot) {
    std::map<std::string, std::size_t> by_id;
    RETURN_IF_ERROR(ForEachRow(writing_, kSequences, [&](const SqliteStatement& row) {
      by_id.emplace(row.Text(0), snapshot.sequences.size());
      StoredSequence& sequence = snapshot.sequences.emplace_back();
      sequence.opened = {.id = row.Text(0),
                         .session = row.Text(1),
                         .name = row.Text(2),
                         .frames_per_second = row.Number(3),
                         .metres_per_unit = row.Number(4),
                         .up = row.Text(5)};
      sequence.closed = row.Integer(6) != 0;
      sequence.frame_count = row.Integer(7);
      if (!sequence.closed || sequence.frame_count == 0) sequence.frames.emplace();
      return absl::OkStatus();
    }));
    return ForEachRow(writing_, kFramesInUse, [&](const SqliteStatement& row) -> absl::Status {
      const auto found = by_id.find(row.Text(0));
      if (found == by_id.end()) return absl::DataLossError(fmt::format("a frame belongs to sequence {}, which is not on record", row.Text(0)));
      StoredSequence& sequence = snapshot.sequences[found->second];
      if (!sequence.frames) sequence.frames.emplace();
      sequence.frames->push_back(FrameOf(row));
      return absl::OkStatus();
    });
  }

  absl::Status LoadJobs(Snapshot& snapshot) {
    std::map<std::string, std::size_t> by_id;
    RETURN_IF_ERROR(ForEachRow(writing_, kJobs, [&](const SqliteStatement& row) {
      by_id.emplace(row.Text(0), snapshot.jobs.size());
      snapshot.jobs.push_back({.added = {.id = row.Text(0),
                                         .sequence = row.Text(1),
                                         .user = row.Text(2),
                                         .priority = static_cast<std::int32_t>(row.Integer(3)),
                                         .spec_json = row.Text(4),
                                         .terms = {.workers_max = static_cast<std::int32_t>(row.Integer(9)),
                                                   .deadline = row.Number(10),
                                                   .memory_limit = row.Integer(11),
                                                   .time_factor = row.Number(12)},
                                         .submitted = row.Number(7)},
                               .cancelled = row.Integer(5) != 0,
                               .paused = row.Integer(8) != 0,
                               .ended = row.Integer(6) != 0,
                               .ended_at = row.Number(13)});
      return absl::OkStatus();
    }));
    return ForEachRow(writing_, kFailures, [&](const SqliteStatement& row) -> absl::Status {
      const auto job = by_id.find(row.Text(0));
      if (job == by_id.end()) return absl::DataLossError(fmt::format("a failure belongs to job {}, which is not on record", row.Text(0)));
      snapshot.jobs[job->second].failures.push_back(
          {.job = row.Text(0), .task = row.Text(1), .cause = static_cast<core::Cause>(row.Integer(2)), .message = row.Text(3)});
      return absl::OkStatus();
    });
  }

  const std::filesystem::path path_;
  std::optional<StateLock> lock_;
  std::int64_t term_ = 0;
  SqliteConnection writing_;
  RecordWriter writer_{writing_};
  std::optional<SqliteStatement> newest_term_;
  std::mutex reading_mutex_;
  SqliteConnection reading_;                    // guarded by reading_mutex_
  std::optional<SqliteStatement> find_result_;  // guarded by reading_mutex_
};

}  // namespace

absl::StatusOr<std::unique_ptr<Store>> OpenSqliteStore(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(SqliteConnection writing, SqliteConnection::Open(path));
  ASSIGN_OR_RETURN(SqliteConnection reading, SqliteConnection::Open(path));
  return std::make_unique<SqliteStore>(path, std::move(writing), std::move(reading));
}

}  // namespace vorocast::store
