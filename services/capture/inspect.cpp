// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/inspect.h"

#include <algorithm>
#include <numeric>

namespace vorocast::capture {
namespace {

/// Parts of a mesh that no shared vertex joins.
std::int32_t CountComponents(const geometry::TriangleMesh& mesh) {
  std::vector<std::int32_t> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto find = [&](std::int32_t v) {
    const auto at = [&](std::int32_t i) -> std::int32_t& { return parent[static_cast<std::size_t>(i)]; };
    while (at(v) != v) v = at(v) = at(at(v));
    return v;
  };
  auto components = static_cast<std::int32_t>(mesh.vertices.size());
  for (const auto& t : mesh.triangles) {
    for (std::size_t i = 1; i < 3; ++i) {
      const std::int32_t a = find(t[0]);
      const std::int32_t b = find(t[i]);
      if (a == b) continue;
      parent[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
      --components;
    }
  }
  return components;
}

NormalSource SourceOf(const Frame& frame) {
  if (frame.notes.normals_from_mesh) return NormalSource::kMesh;
  return frame.points.normals.empty() ? NormalSource::kEstimated : NormalSource::kFile;
}

FrameFacts InspectFrame(const CaptureFrame& frame, const FrameReadOptions& options) {
  FrameFacts facts;
  facts.number = frame.number;
  const absl::StatusOr<Frame> read = ReadFrame(frame.path, options);
  facts.status = read.status();
  if (!read.ok()) return facts;
  facts.points = static_cast<std::int64_t>(read->points.size());
  facts.triangles = static_cast<std::int64_t>(read->mesh.triangles.size());
  facts.normals = SourceOf(*read);
  facts.colours = !read->points.colours.empty();
  if (facts.triangles > 0) {
    facts.closed = geometry::IsClosed(read->mesh);
    facts.components = CountComponents(read->mesh);
  }
  for (const geometry::Vec3& p : read->points.positions) facts.box.extend(p);
  facts.notes = read->notes;
  return facts;
}

}  // namespace

absl::StatusOr<Inspection> InspectCapture(const Capture& capture, const base::Progress& progress) {
  if (capture.frames.empty()) return absl::InvalidArgumentError("the capture has no frames to inspect");
  const FrameReadOptions options{.metres_per_unit = capture.metres_per_unit, .up = capture.up, .estimate_normals = false};
  Inspection inspection{.capture = capture, .frames = {}};
  inspection.frames.reserve(capture.frames.size());
  for (const CaptureFrame& frame : capture.frames) {
    inspection.frames.push_back(InspectFrame(frame, options));
    base::Report(progress, static_cast<double>(inspection.frames.size()) / static_cast<double>(capture.frames.size()));
  }
  return inspection;
}

}  // namespace vorocast::capture
