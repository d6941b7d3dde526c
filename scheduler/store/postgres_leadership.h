// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <mutex>
#include <string>

#include "scheduler/store/postgres_connection.h"

namespace vorocast::store {

/// Who leads among the schedulers of one database: the holder of an advisory lock, on a connection that does nothing else. The lock passes on
/// when its holder dies; a holder that was stopped gives no sign of life, and its connections are ended by whoever wants to lead. The lock only
/// elects: what keeps an old leader from writing is the term, which is raised by each new one and checked in every transaction.
class PostgresLeadership {
 public:
  PostgresLeadership(std::string url, std::string application) : connection_(std::move(url), std::move(application)) {}
  /// Gives the lock back. The server would, too, but only once it has noticed that the connection ended.
  ~PostgresLeadership();
  PostgresLeadership(const PostgresLeadership&) = delete;
  PostgresLeadership& operator=(const PostgresLeadership&) = delete;

  /// Returns the new term. FAILED_PRECONDITION names the leader.
  absl::StatusOr<std::int64_t> Take(const std::string& address);
  /// FAILED_PRECONDITION when another leads, or led, since.
  absl::Status Keep();
  std::string LeaderAddress();

 private:
  absl::StatusOr<bool> TryLock();
  absl::Status EndSilentHolder();
  absl::StatusOr<PostgresRows> Leader();

  std::mutex mutex_;
  PostgresConnection connection_;  // guarded by mutex_
  std::int64_t term_ = 0;          // guarded by mutex_
  bool locked_ = false;            // guarded by mutex_; as of the last answer
};

}  // namespace vorocast::store
