// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/local_isovalue.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace vorocast::cvt {
namespace {

using geometry::Vec3f;

/// The own isovalue is a mean over the points within about this many cells…
constexpr float kCoarseCells = 2;
/// …and may differ from the common one by this much, the indicator being 1 inside and 0 outside.
constexpr float kLargestShift = 0.3F;

float MeanAtPoints(const SortedPoints& points, const std::vector<float>& at_point) {
  double sum = 0;
  double area = 0;
  for (std::size_t p = 0; p < at_point.size(); ++p) {
    sum += static_cast<double>(points.points()[p].area) * at_point[p];
    area += points.points()[p].area;
  }
  return static_cast<float>(sum / area);
}

/// Means of the points' values around the nodes of a coarse grid, drawn towards 0 where there are few points.
class CoarseMeans {
 public:
  CoarseMeans(const GridFrame& frame, const SortedPoints& points, const std::vector<float>& at_point, float isovalue) {
    for (std::size_t a = 0; a < 3; ++a) nodes_[a] = static_cast<std::size_t>(static_cast<float>(frame.nodes[a]) / kCoarseCells) + 4;
    std::vector<std::array<float, 2>> sums(nodes_[0] * nodes_[1] * nodes_[2], {0, 0});
    for (std::size_t p = 0; p < at_point.size(); ++p) Add(points.points()[p], at_point[p] - isovalue, sums);
    // A surface right through a node gives Σ area w ≈ 0.56 coarse cells²; a tenth of that is hardly any.
    constexpr float kHardlyAny = 0.05F * kCoarseCells * kCoarseCells;
    for (const auto& [area, sum] : sums) shift_.push_back(std::clamp(sum / (area + kHardlyAny), -kLargestShift, kLargestShift));
  }

  /// Subtracts the trilinear interpolant of the means from a row of fine nodes.
  void SubtractFrom(std::int32_t i, std::int32_t j, std::int32_t count, float* row) const {
    const float x = static_cast<float>(i) / kCoarseCells + 1;
    const float y = static_cast<float>(j) / kCoarseCells + 1;
    const float tx = x - std::floor(x);
    const float ty = y - std::floor(y);
    const float* r00 = &shift_[(static_cast<std::size_t>(x) * nodes_[1] + static_cast<std::size_t>(y)) * nodes_[2]];
    const float* r01 = r00 + nodes_[2];
    const float* r10 = r00 + nodes_[1] * nodes_[2];
    const float* r11 = r10 + nodes_[2];
    const auto coarse = [&](std::size_t k) { return (1 - tx) * ((1 - ty) * r00[k] + ty * r01[k]) + tx * ((1 - ty) * r10[k] + ty * r11[k]); };
    float low = coarse(1);
    for (std::int32_t k = 0; k < count; k += 2) {
      const float high = coarse(static_cast<std::size_t>(k / 2) + 2);
      row[k] -= low;
      if (k + 1 < count) row[k + 1] -= 0.5F * (low + high);
      low = high;
    }
  }

 private:
  void Add(const GridPoint& point, float value, std::vector<std::array<float, 2>>& sums) const {
    std::array<std::size_t, 3> first;
    std::array<std::array<float, 3>, 3> weight;
    for (std::size_t a = 0; a < 3; ++a) {
      const float x = point.u[static_cast<Eigen::Index>(a)] / kCoarseCells + 1;
      const float nearest = std::round(x);
      const float t = x - nearest;
      first[a] = static_cast<std::size_t>(nearest) - 1;
      weight[a] = {0.5F * (0.5F - t) * (0.5F - t), 0.75F - t * t, 0.5F * (0.5F + t) * (0.5F + t)};
    }
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        for (std::size_t k = 0; k < 3; ++k) {
          auto& [area, sum] = sums[((first[0] + i) * nodes_[1] + first[1] + j) * nodes_[2] + first[2] + k];
          const float w = point.area * weight[0][i] * weight[1][j] * weight[2][k];
          area += w;
          sum += w * value;
        }
      }
    }
  }

  std::array<std::size_t, 3> nodes_;
  std::vector<float> shift_;
};

}  // namespace

void SubtractLocalIsovalue(const SortedPoints& points, ScalarGrid& indicator) {
  std::vector<float> at_point;
  at_point.reserve(points.points().size());
  for (const GridPoint& p : points.points()) at_point.push_back(Interpolate(indicator, p.u));
  const float isovalue = MeanAtPoints(points, at_point);
  const CoarseMeans means(indicator.frame, points, at_point, isovalue);
  for (std::int32_t i = 0; i < indicator.frame.nodes[0]; ++i) {
    for (std::int32_t j = 0; j < indicator.frame.nodes[1]; ++j) {
      float* row = &indicator.value[indicator.frame.Index(i, j, 0)];
      for (std::int32_t k = 0; k < indicator.frame.nodes[2]; ++k) row[k] -= isovalue;
      means.SubtractFrom(i, j, indicator.frame.nodes[2], row);
    }
  }
}

}  // namespace vorocast::cvt
