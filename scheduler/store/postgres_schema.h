// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "scheduler/store/postgres_connection.h"

namespace vorocast::store {

/// Every migration that the database has not been through; only while holding the leadership's lock.
/// FAILED_PRECONDITION for one that a newer version has written.
absl::Status PreparePostgres(PostgresConnection& connection);

}  // namespace vorocast::store
