// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/unit/workers/tracking/limb.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "services/base/random.h"
#include "tests/unit/workers/tracking/lattice_cells.h"

namespace vorocast::tracking {

using geometry::Rigid3;
using geometry::TriangleMesh;
using geometry::Vec3;

TriangleMesh LimbMesh() {
  constexpr int kRings = 60;
  constexpr int kSegments = 40;
  TriangleMesh mesh;
  for (int i = 0; i < kRings; ++i) {
    const double s = -1 + 2.0 * i / (kRings - 1);
    for (int j = 0; j < kSegments; ++j) {
      const double a = 2 * std::numbers::pi * j / kSegments;
      const double round = std::sqrt(std::max(0.0, 1 - 0.97 * std::pow(s, 8)));
      const double radius = round * (0.06 + 0.012 * std::cos(2 * a) + 0.008 * std::cos(3 * a + 2 * s) + 0.006 * std::sin(9 * s + a));
      mesh.vertices.emplace_back(0.3 * s, radius * std::cos(a), radius * std::sin(a));
    }
  }
  const auto at = [](int ring, int segment) { return ring * kSegments + segment % kSegments; };
  for (int i = 0; i + 1 < kRings; ++i) {
    for (int j = 0; j < kSegments; ++j) {
      mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i + 1, j)});
    }
  }
  for (const int ring : {0, kRings - 1}) {
    const auto centre = static_cast<std::int32_t>(mesh.vertices.size());
    mesh.vertices.emplace_back(ring == 0 ? -0.3 : 0.3, 0, 0);
    for (int j = 0; j < kSegments; ++j) {
      if (ring == 0) mesh.triangles.push_back({centre, at(ring, j + 1), at(ring, j)});
      if (ring != 0) mesh.triangles.push_back({centre, at(ring, j), at(ring, j + 1)});
    }
  }
  if (geometry::SignedVolume(mesh) < 0) {
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  }
  return mesh;
}

Vec3 Bend(const Vec3& x, double angle) {
  constexpr double kHalfWidth = 0.15;
  const double t = std::clamp((x.x() + kHalfWidth) / (2 * kHalfWidth), 0.0, 1.0);
  const double share = t * t * (3 - 2 * t);
  return Eigen::AngleAxisd(share * angle, Vec3::UnitZ()) * x;
}

TriangleMesh Bent(TriangleMesh mesh, double angle) {
  for (Vec3& v : mesh.vertices) v = Bend(v, angle);
  return mesh;
}

TriangleMesh Moved(TriangleMesh mesh, const Rigid3& pose) {
  for (Vec3& v : mesh.vertices) v = pose * v;
  return mesh;
}

geometry::Template LimbTemplate(std::int32_t frame) {
  geometry::Template model;
  model.cells = LatticeCells(LimbMesh(), 0.025, Vec3(0.012, 0.004, 0.002));
  model.frame = frame;
  model.patch = ClusterPatches(model.cells, 60, 1).value();
  model.patch_count = 1 + *std::ranges::max_element(model.patch);
  return model;
}

Observation Observe(std::int32_t frame, const TriangleMesh& mesh, std::size_t points, double noise_m) {
  Observation observation;
  observation.frame = frame;
  observation.surface = geometry::SampleSurface(mesh, points, 1000 + static_cast<std::uint64_t>(frame));
  base::Random random(static_cast<std::uint64_t>(frame) + 1);
  for (Vec3& x : observation.surface.positions) x += noise_m * Vec3(random.Gaussian(), random.Gaussian(), random.Gaussian());
  const geometry::Cells cells = LatticeCells(mesh, 0.03, 0.03 * Vec3(random.Uniform(), random.Uniform(), random.Uniform()));
  observation.inner = cells.centroid;
  observation.inner_depth = cells.depth;
  return observation;
}

geometry::PoseTrack ConstantTrack(const geometry::Template& model, std::vector<std::int32_t> frames, const Rigid3& pose) {
  geometry::PoseTrack track;
  track.patch_count = model.patch_count;
  track.world_from_template.assign(frames.size() * static_cast<std::size_t>(model.patch_count), pose);
  track.state.assign(frames.size(), geometry::FrameState::kTracked);
  track.residual.assign(frames.size(), 0);
  track.confidence.assign(frames.size(), 1);
  track.frames = std::move(frames);
  return track;
}

}  // namespace vorocast::tracking
