// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "scheduler/plan/plan.h"

namespace vorocast::fuzz {

/// Frames 0 to count − 1, each of another blob.
inline std::vector<plan::PlannedFrame> SmallTake(std::int32_t count) {
  std::vector<plan::PlannedFrame> frames;
  for (std::int32_t i = 0; i < count; ++i) frames.push_back({.number = i, .blob = base::HashBytes(std::to_string(i)), .extension = ".ply"});
  return frames;
}

}  // namespace vorocast::fuzz
