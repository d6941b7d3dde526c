// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/moved_cell.h"

#include <algorithm>

#include "workers/cvt/lanes.h"

namespace vorocast::cvt {
namespace {

/// Least sine (roughly) of the angles at which three planes may meet: below, rounding blurs the corner.
constexpr double kLeastSine = 1e-5;
/// How far a corner may lie beyond a plane by rounding, in shares of the cell's squared radius.
constexpr double kRounding = 1e-13;

/// Four vectors, by coordinates.
struct Vectors {
  Lanes x, y, z;
};

Vectors Cross(const Vectors& a, const Vectors& b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

/// The planes in one slot of four corners, and their |p|².
struct Planes {
  Vectors p;
  Lanes square;
};

Planes PlanesOf(const HalfSpace* planes, const std::array<const CellCorner*, 4>& corners, int slot) {
  std::array<Lanes, 4> rows;
  for (std::size_t k = 0; k < 4; ++k) rows[k] = LoadLanes(planes[corners[k]->plane[slot]].p.data());
  Transpose(&rows[0], &rows[1], &rows[2], &rows[3]);
  return {{rows[0], rows[1], rows[2]}, rows[3]};
}

}  // namespace

bool MovedCell::Find(std::span<const HalfSpace> planes, std::span<const CellCorner> corners) {
  const std::size_t count = corners.size();
  const std::size_t padded = (count + 3) & ~std::size_t{3};
  if (x_.size() < padded) {
    for (auto* values : {&x_, &y_, &z_}) values->resize(2 * padded);
  }
  padded_count_ = static_cast<std::int32_t>(padded);
  LaneMask proper{-1, -1, -1, -1};
  Lanes furthest = Splat(0);
  for (std::size_t i = 0; i < padded; i += 4) {
    std::array<const CellCorner*, 4> four;
    for (std::size_t k = 0; k < 4; ++k) four[k] = &corners[std::min(i + k, count - 1)];
    const Planes a = PlanesOf(planes.data(), four, 0);
    const Planes b = PlanesOf(planes.data(), four, 1);
    const Planes c = PlanesOf(planes.data(), four, 2);
    const Vectors bc = Cross(b.p, c.p);
    const Vectors ca = Cross(c.p, a.p);
    const Vectors ab = Cross(a.p, b.p);
    const Lanes volume = a.p.x * bc.x + a.p.y * bc.y + a.p.z * bc.z;
    proper &= (volume > 0.0) & (volume * volume > kLeastSine * kLeastSine * (a.square * b.square * c.square));
    const Lanes inverse = 1.0 / volume;
    const Lanes x = (a.square * bc.x + b.square * ca.x + c.square * ab.x) * inverse;
    const Lanes y = (a.square * bc.y + b.square * ca.y + c.square * ab.y) * inverse;
    const Lanes z = (a.square * bc.z + b.square * ca.z + c.square * ab.z) * inverse;
    StoreLanes(x, &x_[i]);
    StoreLanes(y, &y_[i]);
    StoreLanes(z, &z_[i]);
    furthest = Max(furthest, x * x + y * y + z * z);
  }
  if (SumOf(proper) != -4) return false;
  radius_squared_ = HighestOf(furthest);
  const double rounding = kRounding * radius_squared_;
  LaneMask beyond{};
  for (const HalfSpace& plane : planes) {
    const Lanes limit = Splat(plane.square + rounding);
    for (std::size_t i = 0; i < padded; i += 4) {
      beyond |= plane.p.x() * LoadLanes(&x_[i]) + plane.p.y() * LoadLanes(&y_[i]) + plane.p.z() * LoadLanes(&z_[i]) > limit;
    }
  }
  return SumOf(beyond) == 0;
}

bool MovedCell::IsCutBy(const geometry::Vec3& p) const {
  const Lanes square = Splat(p.squaredNorm());
  LaneMask beyond{};
  for (std::int32_t i = 0; i < padded_count_; i += 4) {
    beyond |= p.x() * LoadLanes(&x_[i]) + p.y() * LoadLanes(&y_[i]) + p.z() * LoadLanes(&z_[i]) > square;
  }
  return SumOf(beyond) != 0;
}

}  // namespace vorocast::cvt
