// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "services/base/status.h"
#include "services/capture/capture.h"
#include "services/geometry/triangle_mesh.h"
#include "services/synth/cage.h"
#include "services/synth/dancer.h"
#include "services/synth/skirt.h"

namespace vorocast::synth {

/// Closed meshes of one connectivity in motion: what is scanned.
class Performance {
 public:
  virtual ~Performance() = default;

  const std::string& name() const { return name_; }
  double frames_per_second() const { return frames_per_second_; }
  std::int32_t frame_count() const { return frame_count_; }
  std::int32_t components() const { return components_; }
  /// The surface: triangles, a colour and a part a vertex. Its vertices are those of some frame.
  const geometry::TriangleMesh& surface() const { return surface_; }
  const std::vector<std::int32_t>& part() const { return part_; }
  /// True when the truth should hold every vertex, false when a sample of those that the cameras see will do.
  bool every_vertex_counts() const { return every_vertex_counts_; }

  /// The vertices in a frame, metres and y up.
  virtual std::vector<geometry::Vec3> VerticesAt(std::int32_t frame) const = 0;

 protected:
  std::string name_;
  double frames_per_second_ = 25;
  std::int32_t frame_count_ = 0;
  std::int32_t components_ = 0;
  geometry::TriangleMesh surface_;
  std::vector<std::int32_t> part_;
  bool every_vertex_counts_ = false;
};

/// The built-in dance. The dancer's body and the skirt are closed shells that sink into each other at the waist; the cage hangs free.
class Dance : public Performance {
 public:
  Dance(std::int32_t frames, double frames_per_second);

  std::vector<geometry::Vec3> VerticesAt(std::int32_t frame) const override;
  /// Vertices [0, this) are the body's, then come the skirt's, then from cage_begin() on the cage's.
  std::size_t skirt_begin() const { return body_.rest.vertices.size(); }
  std::size_t cage_begin() const { return cage_begin_; }

 private:
  SkinnedBody body_;
  geometry::TriangleMesh cage_;
  std::size_t cage_begin_ = 0;
  std::vector<SkirtShape> skirt_shapes_;           // a frame
  std::vector<geometry::Rigid3> world_from_cage_;  // a frame
};

/// Another capture's meshes, held in memory.
class MeshCapture : public Performance {
 public:
  static absl::StatusOr<MeshCapture> Open(const std::filesystem::path& folder, const capture::CaptureOptions& options);

  std::vector<geometry::Vec3> VerticesAt(std::int32_t frame) const override { return vertices_[static_cast<std::size_t>(frame)]; }

 private:
  std::vector<std::vector<geometry::Vec3>> vertices_;
};

}  // namespace vorocast::synth
