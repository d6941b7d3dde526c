// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <nanoflann.hpp>

#include "services/rendering/palette.h"
#include "services/rendering/subjects.h"

namespace vorocast::rendering {
namespace {

using geometry::Vec3;
using geometry::Vec3f;

constexpr std::size_t kNeighbours = 6;
/// In units of the distance to the sixth neighbour: enough to close the surface.
constexpr float kOverlap = 0.62F;
/// No disc is wider than this many times the usual one: a stray point must not become a plate.
constexpr float kWidest = 1.5F;
/// Captured colours hold the light of the stage already: without a lift they would be lit, and darkened, twice.
constexpr float kLift = 1.15F;
constexpr float kBlack = 0.012F;
Vec3f Clay() { return {0.72F, 0.62F, 0.53F}; }

/// nanoflann's view of the positions.
struct Positions {
  const std::vector<Vec3>& points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const { return points[i][static_cast<Eigen::Index>(axis)]; }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Positions>, Positions, 3, std::uint32_t>;

std::vector<float> Radii(const std::vector<Vec3>& points) {
  const Positions positions{points};
  const Tree tree(3, positions, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  std::vector<float> radii;
  radii.reserve(points.size());
  std::array<std::uint32_t, kNeighbours + 1> found;
  std::array<double, kNeighbours + 1> squared;
  for (const Vec3& p : points) {
    const std::size_t count = tree.knnSearch(p.data(), kNeighbours + 1, found.data(), squared.data());
    radii.push_back(kOverlap * static_cast<float>(std::sqrt(squared[count - 1])));
  }
  std::vector<float> sorted = radii;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::ranges::nth_element(sorted, middle);
  const float usual = std::max(*middle, 1e-4F);
  for (float& radius : radii) radius = std::clamp(radius, 0.3F * usual, kWidest * usual);
  return radii;
}

}  // namespace

std::vector<Disc> MakeDiscs(const geometry::OrientedPoints& points) {
  std::vector<Disc> discs;
  if (points.size() == 0) return discs;
  const std::vector<float> radii = Radii(points.positions);
  discs.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    discs.push_back({.centre = points.positions[i].cast<float>(),
                     .normal = points.normals[i].cast<float>(),
                     .radius = radii[i],
                     .colour = points.colours.empty() ? Clay() : Vec3f(kLift * LinearFromRgb8(points.colours[i]) + Vec3f::Constant(kBlack))});
  }
  return discs;
}

absl::Status CheckPicture(const PointsPicture& picture) {
  const geometry::OrientedPoints& points = picture.points;
  if (points.normals.size() == points.size() && (points.colours.empty() || points.colours.size() == points.size())) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{} points have {} normals and {} colours", points.size(), points.normals.size(), points.colours.size()));
}

void AddBounds(const PointsPicture& picture, Bounds& bounds) {
  for (const Vec3& p : picture.points.positions) {
    bounds.centres.push_back(p.cast<float>());
    bounds.radii.push_back(0);
  }
}

}  // namespace vorocast::rendering
