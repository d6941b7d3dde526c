// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/store/migration.h"

#include <fmt/format.h>

namespace vorocast::store {

absl::Status CheckVersion(const std::string& store, std::int64_t found, std::int64_t known) {
  if (found <= known) return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("{}: written by a newer version (schema {}, this program knows {}); use that version", store, found, known));
}

}  // namespace vorocast::store
