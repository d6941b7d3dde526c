// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/store/postgres_leadership.h"

#include <fmt/format.h>

#include "scheduler/store/postgres_schema.h"

namespace vorocast::store {
namespace {

/// A leader speaks once a second.
constexpr std::int64_t kSilenceMaxS = 6;

// The lock's two numbers: this program's, and one for each schema, so that two farms can share a database.
constexpr const char* kTryLock = "SELECT pg_try_advisory_lock(1449422447, hashtext(current_schema()))";
constexpr const char* kUnlock = "SELECT pg_advisory_unlock(1449422447, hashtext(current_schema()))";
constexpr const char* kEndSilentHolder =
    "SELECT pg_terminate_backend(other.pid) FROM pg_locks JOIN pg_stat_activity AS holder USING (pid) JOIN pg_stat_activity AS other "
    "ON other.application_name = holder.application_name AND other.usename = holder.usename WHERE locktype = 'advisory' AND granted "
    "AND database = (SELECT oid FROM pg_database WHERE datname = current_database()) AND classid = 1449422447 "
    "AND objid::bigint = (hashtext(current_schema())::bigint & 4294967295) "
    "AND greatest(holder.state_change, holder.query_start, holder.backend_start) < clock_timestamp() - $1 * interval '1 second'";

}  // namespace

PostgresLeadership::~PostgresLeadership() {
  const std::lock_guard lock(mutex_);
  // A server that does not answer needs nothing given back: the lock ends with the connection.
  if (locked_ && connection_.is_open()) connection_.Ask({kUnlock, {}}).IgnoreError();
}

absl::StatusOr<bool> PostgresLeadership::TryLock() {
  ASSIGN_OR_RETURN(const PostgresRows rows, connection_.Ask({kTryLock, {}}));
  return rows.Truth(0, 0);
}

absl::Status PostgresLeadership::EndSilentHolder() { return connection_.Ask({kEndSilentHolder, PostgresParameters().Add(kSilenceMaxS)}).status(); }

absl::StatusOr<PostgresRows> PostgresLeadership::Leader() {
  ASSIGN_OR_RETURN(const PostgresRows exists, connection_.Ask({"SELECT to_regclass('leader') IS NOT NULL", {}}));
  if (!exists.Truth(0, 0)) return connection_.Ask({"SELECT 0, ''", {}});
  return connection_.Ask({"SELECT term, address FROM leader", {}});
}

absl::StatusOr<std::int64_t> PostgresLeadership::Take(const std::string& address) {
  const std::lock_guard lock(mutex_);
  ASSIGN_OR_RETURN(locked_, TryLock());
  if (!locked_) {
    RETURN_IF_ERROR(EndSilentHolder());
    ASSIGN_OR_RETURN(locked_, TryLock());
  }
  if (!locked_) {
    const auto leader = Leader();
    const std::string at = leader.ok() ? leader->Text(0, 1) : "";
    return absl::FailedPreconditionError(fmt::format("another scheduler leads{}", at.empty() ? "" : " at " + at));
  }
  RETURN_IF_ERROR(PreparePostgres(connection_));
  ASSIGN_OR_RETURN(const PostgresRows rows, connection_.Ask({"UPDATE leader SET term = term + 1, address = $1, since = now() RETURNING term",
                                                             PostgresParameters().Add(address)}));
  term_ = rows.Integer(0, 0);
  return term_;
}

absl::Status PostgresLeadership::Keep() {
  const std::lock_guard lock(mutex_);
  const bool was_open = connection_.is_open();
  auto leader = Leader();
  const bool broke = !connection_.is_open();
  if (was_open && broke) leader = Leader();
  // The lock went with its connection; it may be had again if nobody took it meanwhile, say after a restart of the database.
  if (!was_open || broke) locked_ = false;
  RETURN_IF_ERROR(leader.status());
  if (leader->Integer(0, 0) != term_) {
    return absl::FailedPreconditionError(
        fmt::format("another scheduler leads under term {} at {}; this one's was {}", leader->Integer(0, 0), leader->Text(0, 1), term_));
  }
  if (!locked_) {
    ASSIGN_OR_RETURN(locked_, TryLock());
  }
  return absl::OkStatus();
}

std::string PostgresLeadership::LeaderAddress() {
  const std::lock_guard lock(mutex_);
  const auto leader = Leader();
  return leader.ok() ? leader->Text(0, 1) : std::string();
}

}  // namespace vorocast::store
