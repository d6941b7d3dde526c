// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/store/postgres_schema.h"

#include <iterator>

#include <fmt/format.h>

#include "scheduler/store/migration.h"

namespace vorocast::store {
namespace {

constexpr Migration kMigrations[] = {
    {1, R"(
CREATE TABLE leader(only_row boolean PRIMARY KEY DEFAULT true CHECK (only_row), term bigint NOT NULL, address text NOT NULL, since timestamptz NOT NULL);
INSERT INTO leader(term, address, since) VALUES(0, '', now());
-- The row stays locked to the end of the writer's transaction, so a new leader's term begins after it.
CREATE FUNCTION fence(mine bigint) RETURNS void LANGUAGE plpgsql AS $fence$
DECLARE newest bigint;
BEGIN
  PERFORM 1 FROM leader WHERE term = mine FOR SHARE;
  IF FOUND THEN RETURN; END IF;
  SELECT term INTO newest FROM leader;
  RAISE EXCEPTION 'another scheduler leads under term %; this one''s was %, and nothing more of it is written', newest, mine USING ERRCODE = 'VC001';
END $fence$;
CREATE TABLE counter(name text PRIMARY KEY, value bigint NOT NULL);
CREATE TABLE sequence(position bigserial PRIMARY KEY, id text NOT NULL UNIQUE, session text NOT NULL, name text NOT NULL,
  frames_per_second double precision NOT NULL, metres_per_unit double precision NOT NULL, up text NOT NULL, closed boolean NOT NULL DEFAULT false);
CREATE TABLE frame(sequence text NOT NULL, number integer NOT NULL, blob bytea NOT NULL, extension text NOT NULL, size bigint NOT NULL,
  PRIMARY KEY(sequence, number));
CREATE TABLE job(position bigserial PRIMARY KEY, id text NOT NULL UNIQUE, sequence text NOT NULL, user_name text NOT NULL,
  priority integer NOT NULL, spec text NOT NULL, cancelled boolean NOT NULL DEFAULT false);
CREATE TABLE ended_job(job text PRIMARY KEY, summary bytea NOT NULL, whole bytea NOT NULL);
CREATE TABLE failure(job text NOT NULL, task text NOT NULL, cause integer NOT NULL, message text NOT NULL, PRIMARY KEY(job, task));
CREATE TABLE result(key bytea PRIMARY KEY, sha256 bytea NOT NULL, size bigint NOT NULL, seconds double precision NOT NULL,
  cpu_seconds double precision NOT NULL, memory_peak bigint NOT NULL, made_for text NOT NULL);
CREATE TABLE run(key bytea PRIMARY KEY, attempt bigint NOT NULL, worker text NOT NULL, failed integer NOT NULL, interrupted integer NOT NULL,
  memory_raised integer NOT NULL);
)"},
    // When jobs came and ended, on what terms they run; a second attempt at a task that takes long.
    {2, R"(
ALTER TABLE job ADD COLUMN submitted double precision NOT NULL DEFAULT 0, ADD COLUMN paused boolean NOT NULL DEFAULT false,
  ADD COLUMN workers_max integer NOT NULL DEFAULT 0, ADD COLUMN deadline double precision NOT NULL DEFAULT 0,
  ADD COLUMN memory_limit bigint NOT NULL DEFAULT 0, ADD COLUMN time_factor double precision NOT NULL DEFAULT 1;
ALTER TABLE ended_job ADD COLUMN ended double precision NOT NULL DEFAULT 0;
ALTER TABLE run ADD COLUMN time_raised integer NOT NULL DEFAULT 0, ADD COLUMN copy_attempt bigint NOT NULL DEFAULT 0,
  ADD COLUMN copy_worker text NOT NULL DEFAULT '';
)"},
    // What became of each attempt, in the order that a job's attempts ended (microseconds since 1970), and what the few that print printed.
    {3, R"(
CREATE TABLE attempt(job text COLLATE "C" NOT NULL, ended bigint NOT NULL, number bigint NOT NULL, task text COLLATE "C" NOT NULL,
  kind integer NOT NULL, worker text NOT NULL, lasted bigint NOT NULL, outcome integer NOT NULL, cause integer NOT NULL, message text NOT NULL,
  cpu_seconds double precision NOT NULL, memory_peak bigint NOT NULL, PRIMARY KEY(job, ended, number, task));
CREATE TABLE attempt_log(job text COLLATE "C" NOT NULL, ended bigint NOT NULL, number bigint NOT NULL, task text COLLATE "C" NOT NULL,
  log bytea NOT NULL, PRIMARY KEY(job, ended, number, task));
)"},
};

}  // namespace

absl::Status PreparePostgres(PostgresConnection& connection) {
  RETURN_IF_ERROR(connection.Execute("CREATE TABLE IF NOT EXISTS migration(version bigint PRIMARY KEY, applied timestamptz NOT NULL DEFAULT now())"));
  ASSIGN_OR_RETURN(const PostgresRows rows, connection.Ask({"SELECT coalesce(max(version), 0) FROM migration", {}}));
  const std::int64_t found = rows.Integer(0, 0);
  RETURN_IF_ERROR(CheckVersion("the database", found, std::rbegin(kMigrations)->version));
  for (const Migration& migration : kMigrations) {
    if (migration.version <= found) continue;
    RETURN_IF_ERROR(connection.Execute(fmt::format("BEGIN;{} INSERT INTO migration(version) VALUES({}); COMMIT", migration.sql, migration.version)));
  }
  return absl::OkStatus();
}

}  // namespace vorocast::store
