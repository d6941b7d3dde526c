// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/store/sqlite_schema.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

#include "scheduler/store/migration.h"

namespace vorocast::store {
namespace {

constexpr Migration kMigrations[] = {
    {1, R"(
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
)"},
    // What an ended job looks like, so that it need not be planned again to be shown; terms of leaders.
    {2, R"(
CREATE TABLE ended_job(job TEXT PRIMARY KEY, summary BLOB NOT NULL, whole BLOB NOT NULL);
INSERT INTO meta VALUES('term', 0);
)"},
    // When jobs came and ended, on what terms they run; a second attempt at a task that takes long.
    {3, R"(
ALTER TABLE job ADD COLUMN submitted REAL NOT NULL DEFAULT 0;
ALTER TABLE job ADD COLUMN paused INTEGER NOT NULL DEFAULT 0;
ALTER TABLE job ADD COLUMN workers_max INTEGER NOT NULL DEFAULT 0;
ALTER TABLE job ADD COLUMN deadline REAL NOT NULL DEFAULT 0;
ALTER TABLE job ADD COLUMN memory_limit INTEGER NOT NULL DEFAULT 0;
ALTER TABLE job ADD COLUMN time_factor REAL NOT NULL DEFAULT 1;
ALTER TABLE ended_job ADD COLUMN ended REAL NOT NULL DEFAULT 0;
ALTER TABLE run ADD COLUMN time_raised INTEGER NOT NULL DEFAULT 0;
ALTER TABLE run ADD COLUMN copy_attempt INTEGER NOT NULL DEFAULT 0;
ALTER TABLE run ADD COLUMN copy_worker TEXT NOT NULL DEFAULT '';
)"},
    // What became of each attempt, in the order that a job's attempts ended (microseconds since 1970), and what the few that print printed.
    {4, R"(
CREATE TABLE attempt(job TEXT NOT NULL, ended INTEGER NOT NULL, number INTEGER NOT NULL, task TEXT NOT NULL, kind INTEGER NOT NULL,
  worker TEXT NOT NULL, lasted INTEGER NOT NULL, outcome INTEGER NOT NULL, cause INTEGER NOT NULL, message TEXT NOT NULL, cpu_seconds REAL NOT NULL,
  memory_peak INTEGER NOT NULL, PRIMARY KEY(job, ended, number, task)) WITHOUT ROWID;
CREATE TABLE attempt_log(job TEXT NOT NULL, ended INTEGER NOT NULL, number INTEGER NOT NULL, task TEXT NOT NULL, log BLOB NOT NULL,
  PRIMARY KEY(job, ended, number, task));
)"},
};

absl::StatusOr<std::int64_t> AskInteger(SqliteConnection& connection, std::string_view sql) {
  ASSIGN_OR_RETURN(SqliteStatement statement, SqliteStatement::Prepare(connection, sql));
  ASSIGN_OR_RETURN(const bool found, statement.Next());
  return found ? statement.Integer(0) : 0;
}

}  // namespace

absl::Status PrepareSqlite(SqliteConnection& connection) {
  RETURN_IF_ERROR(connection.Execute("PRAGMA journal_mode = WAL"));
  RETURN_IF_ERROR(connection.Execute("PRAGMA synchronous = FULL"));
  // Versions before the table kept their number in user_version, and still refuse by it what they do not know.
  ASSIGN_OR_RETURN(const std::int64_t before_table, AskInteger(connection, "PRAGMA user_version"));
  RETURN_IF_ERROR(CheckVersion(connection.path(), before_table, std::rbegin(kMigrations)->version));
  RETURN_IF_ERROR(connection.Execute("CREATE TABLE IF NOT EXISTS migration(version INTEGER PRIMARY KEY, applied TEXT NOT NULL)"));
  ASSIGN_OR_RETURN(const std::int64_t listed, AskInteger(connection, "SELECT max(version) FROM migration"));
  const std::int64_t found = std::max(listed, before_table);
  for (const Migration& migration : kMigrations) {
    if (migration.version <= found) continue;
    const absl::Status status =
        connection.Execute(fmt::format("BEGIN IMMEDIATE;{} INSERT INTO migration VALUES({}, datetime('now')); PRAGMA user_version = {}; COMMIT",
                                       migration.sql, migration.version, migration.version));
    if (!status.ok() && sqlite3_get_autocommit(connection.get()) == 0) (void)connection.Execute("ROLLBACK");
    RETURN_IF_ERROR(status);
  }
  return absl::OkStatus();
}

}  // namespace vorocast::store
