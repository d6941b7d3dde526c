// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/performance.h"

#include <fmt/format.h>

#include <numeric>

#include "services/capture/frame_reader.h"
#include "services/synth/choreography.h"
#include "services/synth/synth.h"

namespace vorocast::synth {
namespace {

using geometry::Vec3;

constexpr double kBodyCell_m = 0.0075;
constexpr double kCageCell_m = 0.007;
constexpr double kSettling_s = 3;  // skirt and cage swing this long before the first frame
/// More vertices times frames than this are no take that fits into memory twice.
constexpr std::size_t kMostHeld = 200'000'000;

void Append(const geometry::TriangleMesh& mesh, std::int32_t part, geometry::TriangleMesh& whole, std::vector<std::int32_t>& parts) {
  const auto first = static_cast<std::int32_t>(whole.vertices.size());
  whole.vertices.insert(whole.vertices.end(), mesh.colours.size(), Vec3::Zero());
  whole.colours.insert(whole.colours.end(), mesh.colours.begin(), mesh.colours.end());
  parts.insert(parts.end(), mesh.colours.size(), part);
  for (const auto& t : mesh.triangles) whole.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

/// Numbers the vertices by connected component, in the order of each component's first vertex.
std::int32_t LabelComponents(const geometry::TriangleMesh& mesh, std::vector<std::int32_t>& label) {
  std::vector<std::int32_t> root(mesh.vertices.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&root](std::int32_t v) {
    while (root[static_cast<std::size_t>(v)] != v)
      v = root[static_cast<std::size_t>(v)] = root[static_cast<std::size_t>(root[static_cast<std::size_t>(v)])];
    return v;
  };
  for (const auto& t : mesh.triangles) {
    for (std::size_t c = 1; c < 3; ++c) {
      const std::int32_t a = find(t[0]), b = find(t[c]);
      root[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
    }
  }
  label.assign(root.size(), 0);
  std::int32_t count = 0;
  for (std::int32_t v = 0; v < static_cast<std::int32_t>(root.size()); ++v) {
    const std::int32_t r = find(v);
    label[static_cast<std::size_t>(v)] = r == v ? count++ : label[static_cast<std::size_t>(r)];
  }
  return count;
}

}  // namespace

Dance::Dance(std::int32_t frames, double frames_per_second) : body_(MakeDancer(kBodyCell_m)), cage_(MakeCage(kCageCell_m)) {
  name_ = "Dance with a bird cage";
  frames_per_second_ = frames_per_second;
  frame_count_ = frames;
  components_ = 2;
  surface_ = body_.rest;
  part_ = body_.part;
  Append(SkirtTopology(), static_cast<std::int32_t>(Part::kSkirt), surface_, part_);
  cage_begin_ = surface_.vertices.size();
  Append(cage_, static_cast<std::int32_t>(Part::kCage), surface_, part_);

  SwingingSkirt skirt(-kSettling_s);
  SwingingCage cage(-kSettling_s);
  for (std::int32_t frame = 0; frame < frames; ++frame) {
    const double seconds = frame / frames_per_second;
    skirt.AdvanceTo(seconds);
    cage.AdvanceTo(seconds);
    skirt_shapes_.push_back(skirt.Shape());
    world_from_cage_.push_back(cage.WorldFromCage(seconds));
  }
  surface_.vertices = VerticesAt(0);
}

std::vector<Vec3> Dance::VerticesAt(std::int32_t frame) const {
  const auto f = static_cast<std::size_t>(frame);
  const Pose pose = PoseAt(frame / frames_per_second_);
  std::vector<Vec3> vertices = PoseSkin(body_, pose);
  const std::vector<Vec3> skirt = PlaceSkirt(skirt_shapes_[f], pose);
  vertices.insert(vertices.end(), skirt.begin(), skirt.end());
  for (const Vec3& x : cage_.vertices) vertices.push_back(world_from_cage_[f] * x);
  return vertices;
}

absl::StatusOr<MeshCapture> MeshCapture::Open(const std::filesystem::path& folder, const capture::CaptureOptions& options) {
  ASSIGN_OR_RETURN(const capture::Capture source, capture::OpenCapture(folder, options));
  if (source.frames.empty()) return absl::NotFoundError(fmt::format("{}: there is no frame to scan", folder.string()));
  MeshCapture take;
  take.name_ = source.name;
  take.frames_per_second_ = source.frames_per_second;
  take.frame_count_ = static_cast<std::int32_t>(source.frames.size());
  take.every_vertex_counts_ = true;
  for (const capture::CaptureFrame& file : source.frames) {
    ASSIGN_OR_RETURN(capture::Frame frame, capture::ReadFrame(file.path, {.metres_per_unit = source.metres_per_unit, .up = source.up}));
    if (frame.mesh.triangles.empty())
      return absl::InvalidArgumentError(fmt::format("{}: is a point cloud; only meshes can be scanned", file.path.string()));
    if (take.vertices_.empty()) {
      take.surface_ = frame.mesh;
    } else if (frame.mesh.triangles != take.surface_.triangles || frame.mesh.vertices.size() != take.surface_.vertices.size()) {
      return absl::InvalidArgumentError(fmt::format("{}: its triangles are not those of {}; a truth needs one connectivity in all frames",
                                                    file.path.string(), source.frames[0].path.filename().string()));
    }
    take.vertices_.push_back(std::move(frame.mesh.vertices));
    if (take.vertices_.size() * take.surface_.vertices.size() > kMostHeld) {
      return absl::InvalidArgumentError(fmt::format("{}: {} frames of {} vertices are too many to hold; scan a part of the take (--frames)",
                                                    folder.string(), source.frames.size(), take.surface_.vertices.size()));
    }
  }
  take.components_ = LabelComponents(take.surface_, take.part_);
  return take;
}

}  // namespace vorocast::synth
