// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/store/sqlite_store.h"

#include <map>
#include <mutex>
#include <unordered_map>

#include <fmt/format.h>

#include "scheduler/store/sqlite_connection.h"

namespace vorocast::store {
namespace {

constexpr std::int64_t kSchemaVersion = 1;
constexpr const char* kSchema = R"(
CREATE TABLE meta(name TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE sequence(position INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, session TEXT NOT NULL, name TEXT NOT NULL,
  frames_per_second REAL NOT NULL, metres_per_unit REAL NOT NULL, up TEXT NOT NULL, closed INTEGER NOT NULL DEFAULT 0);
CREATE TABLE frame(sequence TEXT NOT NULL, number INTEGER NOT NULL, blob BLOB NOT NULL, extension TEXT NOT NULL, size INTEGER NOT NULL,
  PRIMARY KEY(sequence, number)) WITHOUT ROWID;
CREATE TABLE job(position INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, sequence TEXT NOT NULL, user TEXT NOT NULL,
  priority INTEGER NOT NULL, spec TEXT NOT NULL, cancelled INTEGER NOT NULL DEFAULT 0);
CREATE TABLE failure(job TEXT NOT NULL, task TEXT NOT NULL, cause INTEGER NOT NULL, message TEXT NOT NULL, PRIMARY KEY(job, task)) WITHOUT ROWID;
CREATE TABLE result(key BLOB PRIMARY KEY, sha256 BLOB NOT NULL, size INTEGER NOT NULL, seconds REAL NOT NULL, cpu_seconds REAL NOT NULL,
  memory_peak INTEGER NOT NULL, made_for TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE run(key BLOB PRIMARY KEY, attempt INTEGER NOT NULL, worker TEXT NOT NULL, failed INTEGER NOT NULL, interrupted INTEGER NOT NULL,
  memory_raised INTEGER NOT NULL) WITHOUT ROWID;
)";

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
    return Write("INSERT OR IGNORE INTO job(id, sequence, user, priority, spec) VALUES(?,?,?,?,?)", r.id, r.sequence, r.user, r.priority,
                 r.spec_json);
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
    return Write("INSERT OR REPLACE INTO run VALUES(?,?,?,?,?,?)", r.key, r.attempt, r.worker, r.tries.failed, r.tries.interrupted,
                 r.tries.memory_raised);
  }
  absl::Status operator()(const core::RunEnded& r) { return Write("DELETE FROM run WHERE key = ?", r.key); }
  absl::Status operator()(const core::AttemptsReserved& r) { return Write("INSERT OR REPLACE INTO meta VALUES('attempt_next', ?)", r.next); }
  absl::Status operator()(const core::JobCancelled& r) { return Write("UPDATE job SET cancelled = 1 WHERE id = ?", r.job); }
  absl::Status operator()(const core::JobRetried& r) {
    RETURN_IF_ERROR(Write("UPDATE job SET cancelled = 0 WHERE id = ?", r.job));
    return Write("DELETE FROM failure WHERE job = ?", r.job);
  }

 private:
  template <typename... Values>
  absl::Status Write(const char* sql, const Values&... values) {
    auto found = statements_.find(sql);
    if (found == statements_.end()) {
      ASSIGN_OR_RETURN(SqliteStatement prepared, SqliteStatement::Prepare(connection_, sql));
      found = statements_.emplace(sql, std::move(prepared)).first;
    }
    (found->second.Bind(values), ...);
    return found->second.Run();
  }

  SqliteConnection& connection_;
  std::unordered_map<const char*, SqliteStatement> statements_;  // by the literal's address
};

class SqliteStore final : public Store {
 public:
  SqliteStore(SqliteConnection writing, SqliteConnection reading) : writing_(std::move(writing)), reading_(std::move(reading)) {}

  absl::StatusOr<Snapshot> Load() override {
    Snapshot snapshot;
    RETURN_IF_ERROR(LoadSequences(snapshot));
    RETURN_IF_ERROR(LoadJobs(snapshot));
    ASSIGN_OR_RETURN(SqliteStatement runs,
                     SqliteStatement::Prepare(writing_, "SELECT key, attempt, worker, failed, interrupted, memory_raised FROM run ORDER BY key"));
    while (true) {
      ASSIGN_OR_RETURN(const bool more, runs.Next());
      if (!more) break;
      snapshot.runs.push_back({.key = runs.Digest(0),
                               .attempt = runs.Integer(1),
                               .worker = runs.Text(2),
                               .tries = {.failed = static_cast<std::int32_t>(runs.Integer(3)),
                                         .interrupted = static_cast<std::int32_t>(runs.Integer(4)),
                                         .memory_raised = static_cast<std::int32_t>(runs.Integer(5))}});
    }
    ASSIGN_OR_RETURN(SqliteStatement meta, SqliteStatement::Prepare(writing_, "SELECT value FROM meta WHERE name = 'attempt_next'"));
    ASSIGN_OR_RETURN(const bool reserved, meta.Next());
    if (reserved) snapshot.attempt_next = meta.Integer(0);
    return snapshot;
  }

  absl::Status Append(const std::vector<Record>& records) override {
    if (records.empty()) return absl::OkStatus();
    RETURN_IF_ERROR(writing_.Execute("BEGIN IMMEDIATE"));
    absl::Status status;
    for (const Record& record : records) {
      status = std::visit(writer_, record);
      if (!status.ok()) break;
    }
    if (status.ok()) status = writing_.Execute("COMMIT");
    if (!status.ok() && sqlite3_get_autocommit(writing_.get()) == 0) (void)writing_.Execute("ROLLBACK");
    return status;
  }

  absl::StatusOr<std::optional<core::Result>> FindResult(const base::Digest& key) override {
    const std::lock_guard lock(reading_mutex_);
    if (!find_result_) {
      ASSIGN_OR_RETURN(
          SqliteStatement prepared,
          SqliteStatement::Prepare(reading_, "SELECT sha256, size, seconds, cpu_seconds, memory_peak, made_for FROM result WHERE key = ?"));
      find_result_.emplace(std::move(prepared));
    }
    find_result_->Bind(key);
    const absl::StatusOr<bool> found = find_result_->Next();
    std::optional<core::Result> result;
    if (found.ok() && *found) {
      result = core::Result{.sha256 = find_result_->Digest(0),
                            .size = find_result_->Integer(1),
                            .seconds = find_result_->Number(2),
                            .cpu_seconds = find_result_->Number(3),
                            .memory_peak = find_result_->Integer(4),
                            .made_for = find_result_->Text(5)};
    }
    find_result_->Reset();
    RETURN_IF_ERROR(found.status());
    return result;
  }

 private:
  absl::Status LoadSequences(Snapshot& snapshot) {
    std::map<std::string, std::size_t> by_id;
    ASSIGN_OR_RETURN(SqliteStatement sequences,
                     SqliteStatement::Prepare(
                         writing_, "SELECT id, session, name, frames_per_second, metres_per_unit, up, closed FROM sequence ORDER BY position"));
    while (true) {
      ASSIGN_OR_RETURN(const bool more, sequences.Next());
      if (!more) break;
      by_id.emplace(sequences.Text(0), snapshot.sequences.size());
      snapshot.sequences.push_back({.opened = {.id = sequences.Text(0),
                                               .session = sequences.Text(1),
                                               .name = sequences.Text(2),
                                               .frames_per_second = sequences.Number(3),
                                               .metres_per_unit = sequences.Number(4),
                                               .up = sequences.Text(5)},
                                    .closed = sequences.Integer(6) != 0});
    }
    ASSIGN_OR_RETURN(SqliteStatement frames,
                     SqliteStatement::Prepare(writing_, "SELECT sequence, number, blob, extension, size FROM frame ORDER BY sequence, number"));
    while (true) {
      ASSIGN_OR_RETURN(const bool more, frames.Next());
      if (!more) break;
      const auto sequence = by_id.find(frames.Text(0));
      if (sequence == by_id.end()) return absl::DataLossError(fmt::format("a frame belongs to sequence {}, which is not on record", frames.Text(0)));
      snapshot.sequences[sequence->second].frames.push_back({.sequence = frames.Text(0),
                                                             .number = static_cast<std::int32_t>(frames.Integer(1)),
                                                             .blob = frames.Digest(2),
                                                             .extension = frames.Text(3),
                                                             .size = frames.Integer(4)});
    }
    return absl::OkStatus();
  }

  absl::Status LoadJobs(Snapshot& snapshot) {
    std::map<std::string, std::size_t> by_id;
    ASSIGN_OR_RETURN(SqliteStatement jobs,
                     SqliteStatement::Prepare(writing_, "SELECT id, sequence, user, priority, spec, cancelled FROM job ORDER BY position"));
    while (true) {
      ASSIGN_OR_RETURN(const bool more, jobs.Next());
      if (!more) break;
      by_id.emplace(jobs.Text(0), snapshot.jobs.size());
      snapshot.jobs.push_back({.added = {.id = jobs.Text(0),
                                         .sequence = jobs.Text(1),
                                         .user = jobs.Text(2),
                                         .priority = static_cast<std::int32_t>(jobs.Integer(3)),
                                         .spec_json = jobs.Text(4)},
                               .cancelled = jobs.Integer(5) != 0});
    }
    ASSIGN_OR_RETURN(SqliteStatement failures,
                     SqliteStatement::Prepare(writing_, "SELECT job, task, cause, message FROM failure ORDER BY job, task"));
    while (true) {
      ASSIGN_OR_RETURN(const bool more, failures.Next());
      if (!more) break;
      const auto job = by_id.find(failures.Text(0));
      if (job == by_id.end()) return absl::DataLossError(fmt::format("a failure belongs to job {}, which is not on record", failures.Text(0)));
      snapshot.jobs[job->second].failures.push_back(
          {.job = failures.Text(0), .task = failures.Text(1), .cause = static_cast<core::Cause>(failures.Integer(2)), .message = failures.Text(3)});
    }
    return absl::OkStatus();
  }

  SqliteConnection writing_;
  RecordWriter writer_{writing_};
  std::mutex reading_mutex_;
  SqliteConnection reading_;                    // guarded by reading_mutex_
  std::optional<SqliteStatement> find_result_;  // guarded by reading_mutex_
};

absl::Status PrepareSchema(SqliteConnection& connection, const std::filesystem::path& path) {
  RETURN_IF_ERROR(connection.Execute("PRAGMA journal_mode = WAL"));
  RETURN_IF_ERROR(connection.Execute("PRAGMA synchronous = FULL"));
  ASSIGN_OR_RETURN(SqliteStatement version, SqliteStatement::Prepare(connection, "PRAGMA user_version"));
  RETURN_IF_ERROR(version.Next().status());
  const std::int64_t found = version.Integer(0);
  version.Reset();
  if (found > kSchemaVersion) {
    return absl::FailedPreconditionError(
        fmt::format("{}: written by a newer version (schema {}, this program knows {}); use that version", path.string(), found, kSchemaVersion));
  }
  if (found == kSchemaVersion) return absl::OkStatus();
  return connection.Execute(fmt::format("BEGIN EXCLUSIVE;{} PRAGMA user_version = {}; COMMIT", kSchema, kSchemaVersion));
}

}  // namespace

absl::StatusOr<std::unique_ptr<Store>> OpenSqliteStore(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(SqliteConnection writing, SqliteConnection::Open(path));
  RETURN_IF_ERROR(PrepareSchema(writing, path));
  ASSIGN_OR_RETURN(SqliteConnection reading, SqliteConnection::Open(path));
  return std::make_unique<SqliteStore>(std::move(writing), std::move(reading));
}

}  // namespace vorocast::store
