// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/faults.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace vorocast::storage {
namespace {

using geometry::Cells;
using geometry::Rigid3;
using geometry::Vec3;

/// How far a stored quaternion or normal may be from unit length.
constexpr double kUnitTolerance = 1e-3;

/// Collects the first fault: each check does nothing once one has failed.
class FaultFinder {
 public:
  explicit FaultFinder(std::string group) : group_(std::move(group)) {}

  void Require(bool right, std::string_view dataset, std::string_view reason) {
    if (fault_.empty() && !right) fault_ = fmt::format("{}{}: {}", group_, dataset, reason);
  }
  void Size(std::size_t size, std::size_t expected, std::string_view dataset) {
    if (size != expected) Require(false, dataset, fmt::format("has {} entries, not {}", size, expected));
  }
  template <typename Values, typename Predicate>
  void Each(const Values& values, std::string_view dataset, std::string_view reason, Predicate right) {
    if (!fault_.empty()) return;
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (!right(values[i])) return Require(false, dataset, fmt::format("entry {} {}", i, reason));
    }
  }
  void Finite(const std::vector<Vec3>& values, std::string_view dataset) {
    Each(values, dataset, "is not finite", [](const Vec3& value) { return value.allFinite(); });
  }
  void Finite(const std::vector<double>& values, std::string_view dataset) {
    Each(values, dataset, "is not finite", [](double value) { return std::isfinite(value); });
  }
  /// rows+1 offsets from 0 to `end`, each row with at least `row_min` entries.
  void Offsets(const std::vector<std::int64_t>& offsets, std::size_t rows, std::size_t end, std::int64_t row_min, std::string_view dataset) {
    Size(offsets.size(), rows + 1, dataset);
    if (!fault_.empty()) return;
    Require(offsets.front() == 0 && offsets.back() == static_cast<std::int64_t>(end), dataset, fmt::format("does not go from 0 to {}", end));
    for (std::size_t i = 0; i < rows && fault_.empty(); ++i) {
      // The difference of two offsets that both lie in 0 … end cannot overflow.
      const bool inside = offsets[i + 1] >= 0 && offsets[i + 1] <= static_cast<std::int64_t>(end);
      if (!inside || offsets[i + 1] - offsets[i] < row_min) Require(false, dataset, fmt::format("entry {} is not ascending as it must", i + 1));
    }
  }
  void Frames(const std::vector<std::int32_t>& frames, std::string_view dataset) {
    for (std::size_t i = 0; i < frames.size() && fault_.empty(); ++i) {
      if (frames[i] < 0 || (i > 0 && frames[i] <= frames[i - 1])) Require(false, dataset, fmt::format("entry {} is not ascending", i));
    }
  }
  void Poses(const std::vector<Rigid3>& poses, std::string_view rotation, std::string_view translation) {
    Each(poses, rotation, "is not a unit quaternion", [](const Rigid3& pose) { return std::abs(pose.rotation.norm() - 1) < kUnitTolerance; });
    Each(poses, translation, "is not finite", [](const Rigid3& pose) { return pose.translation.allFinite(); });
  }
  void CellPoses(const std::vector<Eigen::Vector4f>& rotation, const std::vector<Vec3>& translation, std::size_t count) {
    Size(rotation.size(), count, "/cells/rotation");
    Size(translation.size(), count, "/cells/translation");
    Each(rotation, "/cells/rotation", "is not a unit quaternion",
         [](const Eigen::Vector4f& q) { return std::abs(static_cast<double>(q.norm()) - 1) < kUnitTolerance; });
    Finite(translation, "/cells/translation");
  }
  void Surface(const geometry::OrientedPoints& surface) {
    Finite(surface.positions, "/surface/points");
    Size(surface.normals.size(), surface.size(), "/surface/normals");
    Each(surface.normals, "/surface/normals", "is not a unit vector", [](const Vec3& n) { return std::abs(n.norm() - 1) < kUnitTolerance; });
    if (!surface.colours.empty()) Size(surface.colours.size(), surface.size(), "/surface/colours");
  }
  bool found() const { return !fault_.empty(); }
  const std::string& fault() const { return fault_; }

 private:
  std::string group_;
  std::string fault_;
};

}  // namespace

std::string FaultIn(const Cells& cells, const std::string& group) {
  FaultFinder finder(group);
  const std::size_t n = cells.size();
  const std::size_t f = cells.neighbour.size();
  const auto v = static_cast<std::int64_t>(cells.vertices.size());
  finder.Require(n > 0, "/sites", "there are no cells");
  finder.Finite(cells.sites, "/sites");
  finder.Size(cells.volume.size(), n, "/cells/volume");
  finder.Each(cells.volume, "/cells/volume", "is not a volume", [](double volume) { return std::isfinite(volume) && volume >= 0; });
  finder.Size(cells.centroid.size(), n, "/cells/centroid");
  finder.Finite(cells.centroid, "/cells/centroid");
  finder.Size(cells.boundary.size(), n, "/cells/boundary");
  finder.Each(cells.boundary, "/cells/boundary", "is neither 0 nor 1", [](std::uint8_t flag) { return flag <= 1; });
  finder.Size(cells.depth.size(), n, "/cells/depth");
  finder.Finite(cells.depth, "/cells/depth");
  finder.Size(cells.component.size(), n, "/cells/component");
  finder.Each(cells.component, "/cells/component", "is out of range", [n](std::int32_t c) { return c >= 0 && std::cmp_less(c, n); });

  finder.Offsets(cells.face_offset, n, f, 0, "/cells/face_offset");
  finder.Offsets(cells.vertex_offset, f, cells.vertex.size(), 3, "/faces/vertex_offset");
  finder.Each(cells.vertex, "/faces/vertex", "is out of range", [v](std::int32_t index) { return index >= 0 && index < v; });
  finder.Each(cells.neighbour, "/faces/neighbour", "is out of range", [n](std::int32_t c) { return c >= -1 && (c < 0 || std::cmp_less(c, n)); });
  finder.Finite(cells.vertices, "/vertices");

  finder.Surface(cells.surface);
  finder.Require(std::isfinite(cells.energy) && std::isfinite(cells.surface_area) && cells.iterations >= 0, "@energy",
                 "energy, surface_area or iterations is not a number that can be");
  return finder.fault();
}

std::string FaultIn(const ObservedCells& observed) {
  FaultFinder finder("");
  finder.Surface(observed.surface);
  finder.Finite(observed.centroid, "/cells/centroid");
  finder.Finite(observed.depth, "/cells/depth");
  return finder.fault();
}

std::string FaultIn(const geometry::Template& model, const std::string& group) {
  if (std::string fault = FaultIn(model.cells, group); !fault.empty()) return fault;
  FaultFinder finder(group);
  finder.Require(model.frame >= 0, "@frame", "is negative");
  finder.Size(model.patch.size(), model.cells.size(), "/patch");
  finder.Require(model.patch_count > 0 && std::cmp_less_equal(model.patch_count, model.cells.size()), "/patch",
                 "there must be from one patch to one for each cell");
  if (finder.found()) return finder.fault();
  std::vector<bool> has_cell(static_cast<std::size_t>(model.patch_count), false);
  finder.Each(model.patch, "/patch", "is out of range", [&](std::int32_t patch) {
    if (patch < 0 || patch >= model.patch_count) return false;
    has_cell[static_cast<std::size_t>(patch)] = true;
    return true;
  });
  finder.Each(has_cell, "/patch", "(of the patches) has no cell", [](bool has) { return has; });
  return finder.fault();
}

std::string FaultIn(const geometry::PoseTrack& track) {
  FaultFinder finder("");
  const std::size_t frames = track.frames.size();
  finder.Require(track.patch_count > 0, "/patches/rotation", "there are no patches");
  finder.Frames(track.frames, "/frames");
  finder.Size(track.state.size(), frames, "/frame_state");
  finder.Each(track.state, "/frame_state", "is unknown", [](geometry::FrameState state) { return state <= geometry::FrameState::kInterpolated; });
  finder.Size(track.residual.size(), frames, "/frame_residual");
  finder.Finite(track.residual, "/frame_residual");
  finder.Size(track.confidence.size(), frames, "/frame_confidence");
  finder.Finite(track.confidence, "/frame_confidence");
  if (finder.found()) return finder.fault();
  finder.Size(track.world_from_template.size(), frames * static_cast<std::size_t>(track.patch_count), "/patches/rotation");
  finder.Poses(track.world_from_template, "/patches/rotation", "/patches/translation");
  finder.Require(track.cell_pose.empty() || track.cell_pose.size() % frames == 0, "/cells/rotation", "has not as many cells in every frame");
  finder.Poses(track.cell_pose, "/cells/rotation", "/cells/translation");
  return finder.fault();
}

std::string FaultIn(const geometry::TrackedTake& take) {
  if (std::string fault = FaultIn(take.model, "/template"); !fault.empty()) return fault;
  if (std::string fault = FaultIn(take.patches); !fault.empty()) return fault;
  FaultFinder finder("");
  finder.Require(take.patches.patch_count == take.model.patch_count, "/patches/rotation", "has another number of patches than /template/patch");
  finder.Require(std::isfinite(take.frames_per_second) && take.frames_per_second > 0, "/@frames_per_second", "is not positive");
  finder.CellPoses(take.cell_rotation, take.cell_translation, take.frame_count() * take.cell_count());
  return finder.fault();
}

std::string FaultIn(const geometry::SimulatedTake& take) {
  FaultFinder finder("");
  const std::size_t steps = take.time.size();
  for (const double metres : {take.cell_penetration_m, take.object_penetration_m, take.ground_penetration_m}) {
    finder.Require(std::isfinite(metres) && metres >= 0, "/@cell_penetration_m, @object_penetration_m or @ground_penetration_m", "is not a depth");
  }
  finder.Finite(take.time, "/time");
  finder.Require(std::is_sorted(take.time.begin(), take.time.end()), "/time", "does not ascend");
  finder.Require(steps == 0 ? take.cell_state.empty() : take.cell_state.size() % steps == 0, "/cells/state",
                 "has not as many cells at every instant");
  finder.CellPoses(take.cell_rotation, take.cell_translation, take.cell_state.size());
  finder.Each(take.cell_state, "/cells/state", "is unknown", [](geometry::CellState state) { return state <= geometry::CellState::kGone; });
  if (!take.cell_scale.empty()) {
    finder.Size(take.cell_scale.size(), take.cell_state.size(), "/cells/scale");
    finder.Each(take.cell_scale, "/cells/scale", "is not within 0 and 1", [](float scale) { return scale >= 0 && scale <= 1; });
  }
  if (const geometry::CellMorphs& morph = take.morph; !morph.vertex_offset.empty()) {
    const std::size_t pairs = morph.source.size();
    const auto offsets = [&](const std::vector<std::int64_t>& offset, std::size_t end, const char* name) {
      finder.Size(offset.size(), pairs + 1, name);
      finder.Require(
          !offset.empty() && offset.front() == 0 && offset.back() == static_cast<std::int64_t>(end) && std::is_sorted(offset.begin(), offset.end()),
          name, "does not ascend from 0 to the length that it indexes");
    };
    const auto cells = static_cast<std::int64_t>(steps == 0 ? 0 : take.cell_state.size() / steps);
    finder.Each(morph.source, "/morph/source", "is no cell", [cells](std::int32_t cell) { return cell >= -1 && cell < cells; });
    finder.Size(morph.target.size(), pairs, "/morph/target");
    finder.Each(morph.target, "/morph/target", "is no cell", [](std::int32_t cell) { return cell >= -1; });
    offsets(morph.vertex_offset, morph.from.size(), "/morph/vertex_offset");
    finder.Size(morph.to.size(), morph.from.size(), "/morph/to");
    finder.Finite(morph.from, "/morph/from");
    finder.Finite(morph.to, "/morph/to");
    offsets(morph.triangle_offset, morph.triangles.size(), "/morph/triangle_offset");
    if (finder.found()) return finder.fault();
    for (std::size_t p = 0; p < pairs; ++p) {
      const std::int64_t corners = morph.vertex_offset[p + 1] - morph.vertex_offset[p];
      for (std::int64_t t = morph.triangle_offset[p]; t < morph.triangle_offset[p + 1]; ++t) {
        const auto& triangle = morph.triangles[static_cast<std::size_t>(t)];
        finder.Require(std::all_of(triangle.begin(), triangle.end(), [corners](std::int32_t i) { return i >= 0 && i < corners; }), "/morph/triangles",
                       "has an index out of range");
      }
    }
    const auto share = [](float x) { return x >= 0 && x <= 1; };
    finder.Size(morph.blend.size(), steps * pairs, "/morph/blend");
    finder.Each(morph.blend, "/morph/blend", "is not within 0 and 1", share);
    finder.Size(morph.scale.size(), steps * pairs, "/morph/scale");
    finder.Each(morph.scale, "/morph/scale", "is not within 0 and 2", [](float x) { return x >= 0 && x <= 2; });
    finder.Size(morph.rotation.size(), steps * pairs, "/morph/rotation");
    finder.Each(morph.rotation, "/morph/rotation", "is no unit quaternion",
                [](const Eigen::Vector4f& q) { return q.allFinite() && std::abs(q.norm() - 1) < 1e-3F; });
    finder.Size(morph.translation.size(), steps * pairs, "/morph/translation");
    finder.Each(morph.translation, "/morph/translation", "is not finite", [](const geometry::Vec3f& x) { return x.allFinite(); });
  }
  if (const geometry::CellCopies& copies = take.copies; !copies.offset.empty()) {
    const std::size_t rows = copies.cell.size();
    const auto cells = static_cast<std::int64_t>(steps == 0 ? 0 : take.cell_state.size() / steps);
    finder.Size(copies.offset.size(), steps + 1, "/copies/offset");
    finder.Require(copies.offset.front() == 0 && copies.offset.back() == static_cast<std::int64_t>(rows) &&
                       std::is_sorted(copies.offset.begin(), copies.offset.end()),
                   "/copies/offset", "does not ascend from 0 to the number of rows");
    finder.Each(copies.cell, "/copies/cell", "is no cell", [cells](std::int32_t cell) { return cell >= 0 && cell < cells; });
    finder.Size(copies.copy.size(), rows, "/copies/copy");
    for (std::size_t s = 0; s < steps && !finder.found(); ++s) {
      for (auto i = copies.offset[s] + 1; i < copies.offset[s + 1]; ++i) {
        const auto row = static_cast<std::size_t>(i);
        finder.Require(std::pair(copies.copy[row - 1], copies.cell[row - 1]) < std::pair(copies.copy[row], copies.cell[row]), "/copies/copy",
                       "is not in the order of copies and then of cells at every instant");
      }
    }
    finder.Each(copies.copy, "/copies/copy", "is negative", [](std::int32_t copy) { return copy >= 0; });
    finder.Size(copies.rotation.size(), rows, "/copies/rotation");
    finder.Each(copies.rotation, "/copies/rotation", "is no unit quaternion",
                [](const Eigen::Vector4f& q) { return q.allFinite() && std::abs(q.norm() - 1) < 1e-3F; });
    finder.Size(copies.translation.size(), rows, "/copies/translation");
    finder.Each(copies.translation, "/copies/translation", "is not finite", [](const geometry::Vec3f& x) { return x.allFinite(); });
    finder.Size(copies.scale.size(), rows, "/copies/scale");
    finder.Each(copies.scale, "/copies/scale", "is not within 0 and 1", [](float scale) { return scale >= 0 && scale <= 1; });
  }
  for (const geometry::SceneObject& object : take.objects) {
    finder.Finite(object.mesh.vertices, "/objects/vertices");
    const auto vertices = static_cast<std::int64_t>(object.mesh.vertices.size());
    finder.Each(object.mesh.triangles, "/objects/triangles", "has an index out of range", [vertices](const std::array<std::int32_t, 3>& triangle) {
      return std::all_of(triangle.begin(), triangle.end(), [vertices](std::int32_t index) { return index >= 0 && index < vertices; });
    });
  }
  finder.Size(take.object_pose.size(), steps * take.objects.size(), "/objects/rotation");
  finder.Poses(take.object_pose, "/objects/rotation", "/objects/translation");
  return finder.fault();
}

}  // namespace vorocast::storage
