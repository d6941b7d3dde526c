// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/cell_shapes.h"

#include <LinearMath/btConvexHullComputer.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <limits>
#include <numeric>

namespace vorocast::simulation {
namespace {

using geometry::Cells;
using geometry::Mat3;
using geometry::Quat;
using geometry::Vec3;

constexpr double kExtentMin = 0.001;      // metres; thinner is not simulated
constexpr double kMassFloor = 0.01;       // of the mean mass
constexpr double kInertiaRatioMin = 0.1;  // smallest principal moment by the largest: needles and plates would spin wildly

/// The cell's corners relative to its centroid, each once, in ascending order of their index.
std::vector<Vec3> Corners(const Cells& cells, std::size_t c) {
  std::vector<std::int32_t> indices;
  for (std::int64_t f = cells.face_offset[c]; f < cells.face_offset[c + 1]; ++f) {
    for (std::int64_t i = cells.vertex_offset[static_cast<std::size_t>(f)]; i < cells.vertex_offset[static_cast<std::size_t>(f) + 1]; ++i) {
      indices.push_back(cells.vertex[static_cast<std::size_t>(i)]);
    }
  }
  std::ranges::sort(indices);
  const auto repeated = std::ranges::unique(indices);
  indices.erase(repeated.begin(), repeated.end());
  std::vector<Vec3> corners;
  for (const std::int32_t index : indices) corners.push_back(cells.vertices[static_cast<std::size_t>(index)] - cells.centroid[c]);
  return corners;
}

struct Hull {
  std::vector<Vec3> corners;
  double volume = 0;
  Mat3 covariance = Mat3::Zero();  // ∫ x xᵀ dV about the centroid
};

/// Bullet's exact hull of the corners, its faces moved inwards by `shrink`. Empty when nothing is left.
Hull MakeHull(const std::vector<Vec3>& corners, double shrink) {
  if (corners.size() < 4) return {};
  btConvexHullComputer computer;
  constexpr double kUnitsPerMetre = 100;  // the computer's thresholds are made for sizes around one
  std::vector<double> coordinates;
  for (const Vec3& corner : corners) {
    for (const double x : corner) coordinates.push_back(kUnitsPerMetre * x);
  }
  const btScalar moved = computer.compute(coordinates.data(), 3 * sizeof(double), static_cast<int>(corners.size()),
                                          static_cast<btScalar>(kUnitsPerMetre * shrink), btScalar(0));
  if (moved < 0) return {};
  Hull hull;
  for (int i = 0; i < computer.vertices.size(); ++i) {
    const btVector3& v = computer.vertices[i];
    hull.corners.push_back(Vec3(v.x(), v.y(), v.z()) / kUnitsPerMetre);
  }
  if (hull.corners.size() < 4) return {};
  const Vec3 inside = std::accumulate(hull.corners.begin(), hull.corners.end(), Vec3(Vec3::Zero())) / static_cast<double>(hull.corners.size());
  for (int f = 0; f < computer.faces.size(); ++f) {
    const auto* first = &computer.edges[computer.faces[f]];
    const Vec3 a = hull.corners[static_cast<std::size_t>(first->getSourceVertex())];
    for (const auto* edge = first->getNextEdgeOfFace(); edge->getTargetVertex() != first->getSourceVertex(); edge = edge->getNextEdgeOfFace()) {
      const Vec3 b = hull.corners[static_cast<std::size_t>(edge->getSourceVertex())];
      const Vec3 c = hull.corners[static_cast<std::size_t>(edge->getTargetVertex())];
      // The tetrahedron from the centroid, signed so that the face looks away from the hull's inside.
      const double outward = (a - inside).dot((b - a).cross(c - a)) < 0 ? -1 : 1;
      const double six_volumes = outward * a.dot(b.cross(c));
      const Vec3 sum = a + b + c;
      hull.volume += six_volumes / 6;
      hull.covariance += six_volumes / 120 * (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose());
    }
  }
  return hull;
}

/// Largest coordinate minus smallest along each axis.
Vec3 Extent(const std::vector<Vec3>& points) {
  geometry::Box3 box;
  for (const Vec3& point : points) box.extend(point);
  return box.sizes();
}

std::vector<Vec3> BoxCorners(const Vec3& half) {
  std::vector<Vec3> corners;
  for (int i = 0; i < 8; ++i) corners.emplace_back((i & 1 ? 1 : -1) * half.x(), (i & 2 ? 1 : -1) * half.y(), (i & 4 ? 1 : -1) * half.z());
  return corners;
}

struct PrincipalAxes {
  Quat cell_from_body;
  Vec3 moments;  // ∫ x² dV along each axis
};
PrincipalAxes Diagonalise(const Mat3& covariance) {
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(covariance);
  Mat3 axes = solver.eigenvectors();
  if (axes.determinant() < 0) axes.col(0) = -axes.col(0);
  return {Quat(axes).normalized(), solver.eigenvalues().cwiseMax(0)};
}

/// What stands for a cell that has no proper hull: a box around its corners.
CellShape BoxInstead(const std::vector<Vec3>& corners, double mass, double shrink) {
  Mat3 scatter = Mat3::Zero();
  for (const Vec3& corner : corners) scatter += corner * corner.transpose();
  CellShape shape;
  shape.cell_from_body = corners.empty() ? Quat::Identity() : Diagonalise(scatter).cell_from_body;
  std::vector<Vec3> turned;
  for (const Vec3& corner : corners) turned.push_back(shape.cell_from_body.conjugate() * corner);
  const Vec3 extent = corners.empty() ? Vec3(Vec3::Zero()) : Extent(turned);
  const Vec3 half = (0.5 * extent - Vec3::Constant(shrink)).cwiseMax(0.5 * kExtentMin);
  shape.hull = BoxCorners(half);
  shape.all_corners = shape.hull;
  const Vec3 squares = half.cwiseAbs2();
  shape.mass = mass;
  shape.inertia = mass / 3 * (Vec3::Constant(squares.sum()) - squares);
  return shape;
}

CellShape MakeCellShape(const Cells& cells, std::size_t c, double mass, double shrink) {
  const std::vector<Vec3> corners = Corners(cells, c);
  const Hull whole = MakeHull(corners, 0);
  const Hull shrunk = MakeHull(corners, shrink);
  if (whole.volume <= 0 || shrunk.volume <= 0) return BoxInstead(corners, mass, shrink);

  CellShape shape;
  const PrincipalAxes axes = Diagonalise(whole.covariance);
  shape.cell_from_body = axes.cell_from_body;
  for (const Vec3& corner : ThinOutCorners(shrunk.corners)) shape.hull.push_back(shape.cell_from_body.conjugate() * corner);
  for (const Vec3& corner : shrunk.corners) shape.all_corners.push_back(shape.cell_from_body.conjugate() * corner);
  if (Extent(shape.hull).minCoeff() < kExtentMin) return BoxInstead(corners, mass, shrink);
  shape.mass = mass;
  shape.inertia = mass / whole.volume * (Vec3::Constant(axes.moments.sum()) - axes.moments);
  return shape;
}

}  // namespace

std::vector<Vec3> ThinOutCorners(const std::vector<Vec3>& corners) {
  if (corners.size() <= kHullCorners) return corners;
  std::vector<Vec3> chosen;
  std::vector<double> distance(corners.size(), std::numeric_limits<double>::max());
  const auto farther = [](const Vec3& a, const Vec3& b) { return a.squaredNorm() < b.squaredNorm(); };
  auto next = static_cast<std::size_t>(std::ranges::max_element(corners, farther) - corners.begin());
  while (chosen.size() < kHullCorners) {
    chosen.push_back(corners[next]);
    for (std::size_t i = 0; i < corners.size(); ++i) distance[i] = std::min(distance[i], (corners[i] - chosen.back()).squaredNorm());
    next = static_cast<std::size_t>(std::ranges::max_element(distance) - distance.begin());
  }
  return chosen;
}

std::vector<CellShape> MakeCellShapes(const Cells& cells, const CellSettings& settings) {
  const double shrink = kHullMargin + settings.shrink_m;
  const double total_volume =
      std::accumulate(cells.volume.begin(), cells.volume.end(), 0.0, [](double sum, double v) { return sum + std::max(v, 0.0); });
  const double smallest_volume = std::max(kMassFloor * total_volume / static_cast<double>(cells.size()), kExtentMin * kExtentMin * kExtentMin);
  std::vector<CellShape> shapes;
  shapes.reserve(cells.size());
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const double mass = settings.density_kg_m3 * std::max(cells.volume[c], smallest_volume);
    CellShape shape = MakeCellShape(cells, c, mass, shrink);
    shape.inertia = shape.inertia.cwiseMax(kInertiaRatioMin * shape.inertia.maxCoeff());
    for (const Vec3& corner : shape.all_corners) shape.radius = std::max(shape.radius, corner.norm() + kHullMargin);
    shapes.push_back(std::move(shape));
  }
  return shapes;
}

}  // namespace vorocast::simulation
