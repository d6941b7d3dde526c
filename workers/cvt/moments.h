// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/geometry/vector.h"

namespace vorocast::cvt {

/// Volume, first and second moment of a part of a cell about the cell's site. Everything a cell consists of is a signed sum of
/// tetrahedra with their apex at the site (divergence theorem), so parts may be added in any shape they come in.
struct Moments {
  double volume = 0;                              // ∫ 1
  geometry::Vec3 first = geometry::Vec3::Zero();  // ∫ x
  double second = 0;                              // ∫ |x|²

  /// The cone from the site over the triangle abc.
  void AddCone(const geometry::Vec3& a, const geometry::Vec3& b, const geometry::Vec3& c) {
    const double six_volumes = a.dot(b.cross(c));
    const geometry::Vec3 sum = a + b + c;
    volume += six_volumes / 6;
    first += six_volumes / 24 * sum;
    second += six_volumes / 120 * (sum.squaredNorm() + a.squaredNorm() + b.squaredNorm() + c.squaredNorm());
  }

  /// The cone over the triangle p a b, where a and b lie on the bisector whose nearest point to the site is p (Green's theorem on
  /// the bisector: the edges around a face make the face). `times` is ±1, or 0.
  void AddFaceEdge(const geometry::Vec3& p, double p_squared, const geometry::Vec3& a, const geometry::Vec3& b, double times) {
    const double six_volumes = times * p.dot(a.cross(b));
    volume += six_volumes / 6;
    first += six_volumes / 24 * (p + a + b);
    second += six_volumes / 60 * (3 * p_squared + a.squaredNorm() + b.squaredNorm() + a.dot(b));  // p·a = p·b = |p|²
  }

  /// The cones over both faces of a cell's edge ab, which runs counter-clockwise around the face of p and clockwise around that of q.
  void AddEdge(const geometry::Vec3& p, double p_squared, const geometry::Vec3& q, double q_squared, const geometry::Vec3& a,
               const geometry::Vec3& b) {
    const geometry::Vec3 cross = a.cross(b);
    const double p_volumes = p.dot(cross);
    const double q_volumes = q.dot(cross);
    const double both = p_volumes - q_volumes;
    volume += both / 6;
    first += (p_volumes * p - q_volumes * q + both * (a + b)) / 24;
    second += (3 * (p_volumes * p_squared - q_volumes * q_squared) + both * (a.squaredNorm() + b.squaredNorm() + a.dot(b))) / 60;
  }
};

}  // namespace vorocast::cvt
