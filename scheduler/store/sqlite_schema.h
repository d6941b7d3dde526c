// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "scheduler/store/sqlite_connection.h"

namespace vorocast::store {

/// Write-ahead log, full synchronisation, and every migration that the database has not been through.
/// FAILED_PRECONDITION for one that a newer version has written.
absl::Status PrepareSqlite(SqliteConnection& connection);

}  // namespace vorocast::store
