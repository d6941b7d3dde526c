// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "services/base/random.h"
#include "services/geometry/oriented_points.h"
#include "services/geometry/triangle_mesh.h"
#include "services/synth/synth.h"

namespace vorocast::synth {

/// A pinhole camera; a pixel (x, y) looks along forward + x right + y up, x and y being tangents.
struct DepthCamera {
  geometry::Vec3 position, right, up, forward;
};

/// `count` cameras around `subject` at twice its size, looking at its middle; the odd ones stand higher and look down.
std::vector<DepthCamera> RingOfCameras(const geometry::Box3& subject, std::int32_t count);

/// Scans a surface of fixed connectivity by casting a ray through every pixel (Embree): only what a camera sees becomes a point, so surfaces that
/// are hidden, far or seen at a grazing angle get fewer or none. Not for concurrent use.
class DepthScanner {
 public:
  /// `subject` bounds the surface in all frames. `surface` is kept by reference.
  DepthScanner(const geometry::TriangleMesh& surface, const geometry::Box3& subject, const ScanOptions& options);
  ~DepthScanner();

  /// Sets the pixels' size so that a scan of these vertices sees about a third more points than were asked for; for the whole take.
  void Calibrate(std::span<const geometry::Vec3> vertices);
  /// One frame in random order. The same vertices and frame give the same points.
  geometry::OrientedPoints Scan(std::span<const geometry::Vec3> vertices, std::int32_t frame);
  /// Which vertices at least one camera sees, at less than 80° from head on.
  std::vector<char> Seen(std::span<const geometry::Vec3> vertices);

 private:
  struct Scene;
  struct Hit;
  std::vector<Hit> CastRays(std::span<const geometry::Vec3> vertices, double pixel, base::Random& random) const;

  const geometry::TriangleMesh& surface_;
  ScanOptions options_;
  std::vector<DepthCamera> cameras_;
  double pixel_ = 0;  // tangent of a pixel's width
  std::unique_ptr<Scene> scene_;
};

}  // namespace vorocast::synth
