// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/frame_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "services/base/check.h"
#include "services/capture/estimate_normals.h"
#include "services/capture/file_bytes.h"
#include "services/capture/frame_checks.h"
#include "services/capture/frame_parser.h"
#include "services/capture/units.h"

namespace vorocast::capture {
namespace {

using geometry::Vec3;

constexpr std::array<std::string_view, 4> kExtensions = {".ply", ".obj", ".off", ".drc"};
/// Some hundred times a usual frame; larger files are no frames.
constexpr std::uint64_t kFileSizeMax = std::uint64_t{4} << 30;

std::string LowerExtension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::ranges::transform(extension, extension.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return extension;
}

absl::Status ToMetresYUp(const FrameReadOptions& options, RawFrame& raw) {
  VOROCAST_CHECK(options.metres_per_unit > 0);
  ASSIGN_OR_RETURN(const UpRotation y_up_from_file, UpRotation::Parse(options.up));
  for (Vec3& p : raw.mesh.vertices) p = y_up_from_file * Vec3(options.metres_per_unit * p);
  for (Vec3& n : raw.normals) n = y_up_from_file * n;
  return absl::OkStatus();
}

/// Keeps the vertices that are marked and the triangles between them.
void Compact(const std::vector<bool>& keep, RawFrame& raw) {
  if (std::ranges::find(keep, false) == keep.end()) return;
  std::vector<std::int32_t> new_index(keep.size(), -1);
  std::size_t count = 0;
  for (std::size_t i = 0; i < keep.size(); ++i) {
    if (!keep[i]) continue;
    new_index[i] = static_cast<std::int32_t>(count);
    raw.mesh.vertices[count] = raw.mesh.vertices[i];
    if (!raw.normals.empty()) raw.normals[count] = raw.normals[i];
    if (!raw.mesh.colours.empty()) raw.mesh.colours[count] = raw.mesh.colours[i];
    ++count;
  }
  raw.mesh.vertices.resize(count);
  if (!raw.normals.empty()) raw.normals.resize(count);
  if (!raw.mesh.colours.empty()) raw.mesh.colours.resize(count);
  std::erase_if(raw.mesh.triangles,
                [&](const auto& t) { return std::ranges::any_of(t, [&](auto v) { return !keep[static_cast<std::size_t>(v)]; }); });
  for (auto& triangle : raw.mesh.triangles) {
    for (std::int32_t& v : triangle) v = new_index[static_cast<std::size_t>(v)];
  }
}

void DropLooseVertices(RawFrame& raw, ReadNotes& notes) {
  if (!raw.is_mesh()) return;
  std::vector<bool> used(raw.mesh.vertices.size(), false);
  for (const auto& triangle : raw.mesh.triangles) {
    for (std::int32_t v : triangle) used[static_cast<std::size_t>(v)] = true;
  }
  const auto loose = std::ranges::count(used, false);
  if (loose == 0) return;
  notes.loose_vertices += loose;
  Compact(used, raw);
}

/// Unit length where there is a direction, zero elsewhere. A mesh's own normals fill what its file leaves out.
absl::Status SettleNormals(const FrameReadOptions& options, RawFrame& raw, ReadNotes& notes) {
  std::vector<Vec3> from_mesh;
  if (raw.is_mesh()) from_mesh = geometry::VertexNormals(raw.mesh);
  if (raw.normals.empty() && raw.is_mesh()) {
    notes.normals_from_mesh = true;
    raw.normals = from_mesh;
  } else if (raw.normals.empty() && options.estimate_normals) {
    notes.normals_estimated = true;
    ASSIGN_OR_RETURN(raw.normals, EstimateNormals(raw.mesh.vertices));
  }
  for (std::size_t i = 0; i < raw.normals.size(); ++i) {
    Vec3& n = raw.normals[i];
    const bool has_direction = n.allFinite() && n.stableNorm() > kNormalLengthMin;
    n = has_direction ? n.stableNormalized() : (from_mesh.empty() ? Vec3(Vec3::Zero()) : from_mesh[i]);
  }
  if (raw.is_mesh() && !notes.normals_from_mesh) return CheckAgreement(from_mesh, raw.normals);
  return absl::OkStatus();
}

}  // namespace

bool IsFrameExtension(const std::string& extension) { return std::ranges::find(kExtensions, extension) != kExtensions.end(); }

absl::StatusOr<RawFrame> ParseFrame(std::string_view extension, std::string_view bytes) {
  if (extension == ".ply") return ParsePly(bytes);
  if (extension == ".obj") return ParseObj(bytes);
  if (extension == ".off") return ParseOff(bytes);
  if (extension == ".drc") return ParseDraco(bytes);
  return absl::InvalidArgumentError(fmt::format("'{}' is no format of frames: .ply, .obj, .off and .drc are read", extension));
}

absl::StatusOr<RawFrame> ReadRawFrame(const std::filesystem::path& path) {
  auto bytes = ReadFileBytes(path, kFileSizeMax);
  if (!bytes.ok()) return base::Annotate(bytes.status(), path.string());
  auto raw = ParseFrame(LowerExtension(path), *bytes);
  if (!raw.ok()) return base::Annotate(raw.status(), path.string());
  return raw;
}

absl::StatusOr<Frame> ConvertFrame(RawFrame raw, const FrameReadOptions& options) {
  if (raw.mesh.vertices.empty()) return absl::InvalidArgumentError("the frame is empty: it holds no points; leave it out or capture it again");
  RETURN_IF_ERROR(ToMetresYUp(options, raw));
  Frame frame;
  DropLooseVertices(raw, frame.notes);
  ASSIGN_OR_RETURN(const std::vector<bool> finite, CheckPositions(raw.mesh.vertices));
  frame.notes.dropped_points += std::ranges::count(finite, false);
  Compact(finite, raw);
  RETURN_IF_ERROR(CheckSize(raw.mesh.vertices, options.metres_per_unit));
  RETURN_IF_ERROR(SettleNormals(options, raw, frame.notes));
  if (!raw.normals.empty()) {
    ASSIGN_OR_RETURN(const std::vector<bool> oriented, CheckNormals(raw.normals));
    frame.notes.dropped_points += std::ranges::count(oriented, false);
    Compact(oriented, raw);
    RETURN_IF_ERROR(CheckOutward(raw));
  }
  frame.points = {.positions = raw.mesh.vertices, .normals = std::move(raw.normals), .colours = raw.mesh.colours};
  frame.mesh = std::move(raw.mesh);
  return frame;
}

absl::StatusOr<Frame> ReadFrame(const std::filesystem::path& path, const FrameReadOptions& options) {
  ASSIGN_OR_RETURN(RawFrame raw, ReadRawFrame(path));
  auto frame = ConvertFrame(std::move(raw), options);
  if (!frame.ok()) return base::Annotate(frame.status(), path.string());
  return frame;
}

}  // namespace vorocast::capture
