// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/geometry/cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace vorocast::geometry {

std::vector<std::array<std::int32_t, 2>> NeighbourPairs(const Cells& cells) {
  std::vector<std::array<std::int32_t, 2>> pairs;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    for (std::int64_t f = cells.face_offset[c]; f < cells.face_offset[c + 1]; ++f) {
      const std::int32_t other = cells.neighbour[static_cast<std::size_t>(f)];
      if (other >= 0) pairs.push_back({std::min(static_cast<std::int32_t>(c), other), std::max(static_cast<std::int32_t>(c), other)});
    }
  }
  std::ranges::sort(pairs);
  const auto repeated = std::ranges::unique(pairs);
  pairs.erase(repeated.begin(), repeated.end());
  return pairs;
}

double NormalisedSecondMoment(const Cells& cells) {
  const double n = static_cast<double>(cells.size());
  const double volume = std::accumulate(cells.volume.begin(), cells.volume.end(), 0.0);
  return cells.energy / (3 * n * std::pow(volume / n, 5.0 / 3.0));
}

}  // namespace vorocast::geometry
