// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include "scheduler/store/store.h"

namespace vorocast::store {

/// One PostgreSQL database (or one schema of it: the first of the connection's search_path). A batch is one transaction in one round trip.
/// `url` is what libpq takes, postgresql://USER@HOST/NAME; the password comes from ~/.pgpass or PGPASSWORD. Connects when it is first asked.
/// INVALID_ARGUMENT for a wrong URL, and for one with a password in it.
absl::StatusOr<std::unique_ptr<Store>> OpenPostgresStore(const std::string& url);

}  // namespace vorocast::store
