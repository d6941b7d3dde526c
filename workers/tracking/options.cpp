// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>

#include "workers/tracking/tracking.h"

namespace vorocast::tracking {

absl::Status TrackOptions::Validate() const {
  const auto invalid = [](std::string_view what, double value, std::string_view range) {
    return absl::InvalidArgumentError(fmt::format("tracking options: {} is {}; it must be {}", what, value, range));
  };
  if (iterations < 1 || iterations > 1000) return invalid("iterations", iterations, "1 … 1000");
  if (!(regulariser > 0 && regulariser <= 1000)) return invalid("regulariser", regulariser, "more than 0, at most 1000");
  if (!(sigma_end_m >= 1e-4 && sigma_end_m <= 1)) return invalid("sigma_end_m", sigma_end_m, "0.0001 … 1 metres");
  if (!(sigma_start_m >= sigma_end_m && sigma_start_m <= 1)) return invalid("sigma_start_m", sigma_start_m, "sigma_end_m … 1 metres");
  if (!(normal_angle_max_deg > 0 && normal_angle_max_deg <= 180))
    return invalid("normal_angle_max_deg", normal_angle_max_deg, "more than 0, at most 180");
  if (!(depth_tolerance_m > 0)) return invalid("depth_tolerance_m", depth_tolerance_m, "more than 0");
  return absl::OkStatus();
}

}  // namespace vorocast::tracking
