// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "services/base/status.h"
#include "services/geometry/oriented_points.h"
#include "services/geometry/triangle_mesh.h"

namespace vorocast::capture {

/// A frame as its file holds it: points with or without normals, or a mesh.
struct RawFrame {
  geometry::TriangleMesh mesh;          // vertices always; triangles empty for a point cloud
  std::vector<geometry::Vec3> normals;  // a vertex each, or empty
  bool is_mesh() const { return !mesh.triangles.empty(); }
};

/// By extension: .ply (ascii, binary of both byte orders), .obj, .off, .drc. Memory is bounded by the file's real size: counts that a header
/// declares are checked against the bytes that are there before anything is allocated. Errors say path, place and reason.
absl::StatusOr<RawFrame> ReadRawFrame(const std::filesystem::path& path);
/// The extensions ReadRawFrame takes, lower case, with the dot.
bool IsFrameExtension(const std::string& extension);

struct FrameReadOptions {
  double metres_per_unit = 1;
  std::string up = "+y";
  bool estimate_normals = true;  // false leaves a point cloud without normals as it is, for a quick look
};

struct ReadNotes {
  bool normals_estimated = false;  // CGAL, because the file had none
  bool normals_from_mesh = false;
  std::int64_t dropped_points = 0;  // non-finite positions or zero normals, below the limit that makes a frame unusable
  std::int64_t loose_vertices = 0;  // vertices of a mesh that no triangle uses, left out; any number of them
};

/// A frame as the pipeline sees it.
struct Frame {
  geometry::OrientedPoints points;  // metres, y up, unit outward normals
  geometry::TriangleMesh mesh;      // metres, y up; no triangles for a point cloud
  ReadNotes notes;
};

/// Reads, converts to metres and y up, estimates or computes normals, and refuses what cannot be a person-sized capture:
/// no points, more than 1 % non-finite values or zero normals, inverted normals, larger than 50 m or smaller than 1 cm (with a hint at --units).
absl::StatusOr<Frame> ReadFrame(const std::filesystem::path& path, const FrameReadOptions& options);
/// The same for a frame that has been read; its errors do not name a path.
absl::StatusOr<Frame> ConvertFrame(RawFrame raw, const FrameReadOptions& options);

}  // namespace vorocast::capture
