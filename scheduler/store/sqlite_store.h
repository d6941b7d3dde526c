// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <memory>

#include "scheduler/store/store.h"

namespace vorocast::store {

/// One SQLite database in WAL mode with full synchronisation: a batch is one transaction and costs one fsync.
/// Errors: DATA_LOSS for a damaged file, FAILED_PRECONDITION for one that a newer version has written.
absl::StatusOr<std::unique_ptr<Store>> OpenSqliteStore(const std::filesystem::path& path);

}  // namespace vorocast::store
