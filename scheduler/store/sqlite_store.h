// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <memory>

#include "scheduler/store/store.h"

namespace vorocast::store {

/// One SQLite database in WAL mode with full synchronisation: a batch is one transaction and costs one fsync.
/// Only one process can lead: it holds a lock in the database's folder, which the kernel frees when that process ends, however it ends.
/// UNAVAILABLE when the file cannot be opened; everything else shows when it leads.
absl::StatusOr<std::unique_ptr<Store>> OpenSqliteStore(const std::filesystem::path& path);

}  // namespace vorocast::store
