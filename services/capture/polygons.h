// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace vorocast::capture {

/// Appends a polygon as a fan around its first vertex, leaving out triangles that name a vertex twice: they have no area.
/// Indices must be in range of std::int32_t.
inline void AppendFan(std::span<const std::int64_t> polygon, std::vector<std::array<std::int32_t, 3>>& triangles) {
  for (std::size_t i = 2; i < polygon.size(); ++i) {
    const auto a = static_cast<std::int32_t>(polygon[0]);
    const auto b = static_cast<std::int32_t>(polygon[i - 1]);
    const auto c = static_cast<std::int32_t>(polygon[i]);
    if (a != b && b != c && c != a) triangles.push_back({a, b, c});
  }
}

}  // namespace vorocast::capture
