// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "services/geometry/vector.h"

namespace vorocast::cvt {

/// A bisector seen from the site: the points v with p·v = |p|², p the site's nearest point on it (half the way to the neighbour).
struct HalfSpace {
  geometry::Vec3 p;
  double square;  // |p|²
};

/// A convex polyhedron around the origin that is cut down by half-spaces: one site's Voronoi cell in the making, seen from the site.
/// Every corner lies on exactly three planes, whatever the rounding: combinatorics come first, positions follow.
class ConvexCell {
 public:
  /// A corner is where three planes meet: n0·(n1×n2) > 0. next[s] is the corner at the other end of the edge that leaves plane s,
  /// i.e. the edge of planes s+1 and s+2 (mod 3); walked towards next[s], that edge runs counter-clockwise around the face of plane s+2.
  struct Corner {
    std::array<std::int32_t, 3> plane;
    std::array<std::int32_t, 3> next;
  };

  /// Starts anew from a dodecahedron that contains the ball of radius `reach`; its planes carry the names −1 … −12.
  void Reset(double reach);

  /// Starts from a polyhedron whose corner i has the given planes, neighbours and position.
  template <typename Corners, typename Position>
  void Resume(std::span<const HalfSpace> planes, std::span<const std::int32_t> names, const Corners& corners, Position&& position) {
    Clear(static_cast<std::int32_t>(corners.size()));
    for (std::int32_t i = 0; i < count_; ++i) {
      for (int s = 0; s < 3; ++s) {
        corners_[i].plane[s] = corners[i].plane[s];
        corners_[i].next[s] = corners[i].next[s];
      }
      const geometry::Vec3 at = position(i);
      x_[i] = at.x(), y_[i] = at.y(), z_[i] = at.z();
    }
    planes_.assign(planes.begin(), planes.end());
    names_.assign(names.begin(), names.end());
    starting_at_.assign(planes_.size(), -1);
    UpdateRadius();
  }

  /// Keeps the side of the origin of the plane through p across p. `name` is the neighbour's number.
  /// False when rounding made the cut contradict itself, or when p is the origin; the cell is then void until the next Reset.
  bool Cut(const geometry::Vec3& p, std::int32_t name);

  /// Of the furthest corner from the origin.
  double RadiusSquared() const { return radius_squared_; }

  std::int32_t corner_count() const { return count_; }
  const Corner& corner(std::int32_t i) const { return corners_[i]; }
  geometry::Vec3 position(std::int32_t i) const { return {x_[i], y_[i], z_[i]}; }
  /// Planes in the order of their cuts, also those whose face has been cut away again.
  std::int32_t plane_count() const { return static_cast<std::int32_t>(planes_.size()); }
  const HalfSpace& plane(std::int32_t i) const { return planes_[i]; }
  std::int32_t name(std::int32_t i) const { return names_[i]; }

 private:
  /// On the plane of a cut, on an edge that it crosses.
  struct NewCorner {
    std::int32_t cut;   // the edge's end that is cut away
    std::int32_t kept;  // and the one that stays
    std::int32_t b, c;  // the planes of the edge
    std::int32_t index;
    geometry::Vec3 position;
  };

  static const ConvexCell& UnitDodecahedron();
  void StartAsCube(double half_side);
  void DropUnusedPlanes();
  void Reserve(std::int32_t corners);
  void Clear(std::int32_t corners);
  void FindCrossedEdges();
  bool IsOneLoop();
  void Link(std::int32_t plane);
  void FillHoles(std::int32_t new_count);
  void UpdateRadius();

  std::int32_t count_ = 0;
  std::vector<double> x_, y_, z_, side_;  // [multiple of 4]; zero beyond count_
  std::vector<Corner> corners_;
  std::vector<HalfSpace> planes_;
  std::vector<std::int32_t> names_;
  double radius_squared_ = 0;

  std::int32_t cut_count_ = 0;
  std::int32_t new_count_ = 0;
  std::vector<std::int32_t> cut_;          // corners beyond the plane, ascending
  std::vector<NewCorner> new_corners_;     // on the plane
  std::vector<std::int32_t> starting_at_;  // [planes] the new corner whose edge has this plane as b, or −1
};

}  // namespace vorocast::cvt
