// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/base/status.h"

#include <fmt/format.h>

namespace vorocast::base {

absl::Status Annotate(const absl::Status& status, std::string_view context) {
  if (status.ok()) return status;
  return absl::Status(status.code(), fmt::format("{}: {}", context, std::string(status.message())));
}

}  // namespace vorocast::base
