// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>

#include <cmath>

#include "workers/cvt/indicator.h"

namespace vorocast::cvt {

absl::Status IndicatorOptions::Validate() const {
  if (!std::isfinite(spacing_m) || spacing_m < 0) {
    return absl::InvalidArgumentError(fmt::format("indicator: spacing_m is {}; give metres, or 0 to derive it from the points", spacing_m));
  }
  constexpr std::int64_t kFewestNodes = 32 * 32 * 32;
  constexpr std::int64_t kMostNodes = 512'000'000;
  if (grid_nodes_max < kFewestNodes || grid_nodes_max > kMostNodes) {
    return absl::InvalidArgumentError(fmt::format("indicator: grid_nodes_max is {}; give {} … {}", grid_nodes_max, kFewestNodes, kMostNodes));
  }
  if (!(smoothing_cells >= 0 && smoothing_cells <= 10)) {
    return absl::InvalidArgumentError(fmt::format("indicator: smoothing_cells is {}; give 0 … 10", smoothing_cells));
  }
  return absl::OkStatus();
}

}  // namespace vorocast::cvt
