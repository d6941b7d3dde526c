// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "services/base/status.h"

namespace vorocast::store {

/// One step of a schema. A store's table `migration` lists the versions that it has been through; the missing ones are applied in order, each
/// in a transaction of its own together with its row.
struct Migration {
  std::int64_t version = 0;
  const char* sql = "";
};

/// FAILED_PRECONDITION when the store has been written by a version of this program that knows more.
absl::Status CheckVersion(const std::string& store, std::int64_t found, std::int64_t known);

}  // namespace vorocast::store
