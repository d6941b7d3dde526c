// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/frame_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "services/capture/estimate_normals.h"
#include "services/capture/units.h"

namespace vorocast::capture {
namespace {

using geometry::Vec3;

constexpr double kDroppedMax = 0.01;          // of a frame's points
constexpr double kCoordinateMaxMetres = 1e6;  // beyond it a number is damage, not a place
constexpr double kExtentMaxMetres = 50;
constexpr double kExtentMinMetres = 0.01;
/// An open scan of one side has an outwardness near 0, a person's whole surface 0.2 to 0.3, the same turned inward −0.2 to −0.3.
constexpr double kInward = -0.05;

/// Marks what is good and refuses when too little is.
template <typename Good>
absl::StatusOr<std::vector<bool>> Mark(const std::vector<Vec3>& values, const char* complaint, const char* advice, Good good) {
  std::vector<bool> keep(values.size());
  std::transform(values.begin(), values.end(), keep.begin(), good);
  const auto bad = std::ranges::count(keep, false);
  if (static_cast<double>(bad) <= kDroppedMax * static_cast<double>(values.size())) return keep;
  const auto first = std::ranges::find(keep, false) - keep.begin();
  return absl::InvalidArgumentError(fmt::format("{} of {} {} (the first is point {}): {}", bad, values.size(), complaint, first, advice));
}

/// Side lengths of the box that holds all but the outer 1 % of the points on each axis.
Vec3 CoreExtent(const std::vector<Vec3>& positions) {
  Vec3 extent;
  std::vector<double> values(positions.size());
  const auto outer = static_cast<std::ptrdiff_t>(positions.size() / 200);
  for (int axis = 0; axis < 3; ++axis) {
    std::ranges::transform(positions, values.begin(), [axis](const Vec3& p) { return p[axis]; });
    std::ranges::nth_element(values, values.begin() + outer);
    const double low = values[static_cast<std::size_t>(outer)];
    std::ranges::nth_element(values, values.end() - 1 - outer);
    extent[axis] = *(values.end() - 1 - outer) - low;
  }
  return extent;
}

std::string Length(double metres) { return metres < 0.1 ? fmt::format("{:.3g} m", metres) : fmt::format("{:.1f} m", metres); }

}  // namespace

absl::StatusOr<std::vector<bool>> CheckPositions(const std::vector<Vec3>& positions) {
  return Mark(positions, "positions are not finite", "the file is damaged or its export went wrong; export the frame again",
              [](const Vec3& p) { return p.allFinite() && p.cwiseAbs().maxCoeff() <= kCoordinateMaxMetres; });
}

absl::StatusOr<std::vector<bool>> CheckNormals(const std::vector<Vec3>& normals) {
  return Mark(normals, "normals are zero or not finite", "export the frame with normals, or with none, and they are estimated",
              [](const Vec3& n) { return !n.isZero(); });
}

absl::Status CheckSize(const std::vector<Vec3>& positions, double metres_per_unit) {
  geometry::Box3 box;
  for (const Vec3& p : positions) box.extend(p);
  const double largest = box.sizes().maxCoeff();
  if (largest >= kExtentMinMetres && largest <= kExtentMaxMetres) return absl::OkStatus();
  const double core = CoreExtent(positions).maxCoeff();
  if (largest > kExtentMaxMetres && core <= kExtentMaxMetres / 10) {
    return absl::InvalidArgumentError(
        fmt::format("the frame is {} across, although 99 % of its points lie within {}: remove the stray points", Length(largest), Length(core)));
  }
  if (largest == 0) return absl::InvalidArgumentError("all points of the frame are the same: capture it again");
  const bool tall = box.sizes().y() >= 0.5 * largest;
  const std::string unit = UnitOfPerson(core / metres_per_unit);
  return absl::InvalidArgumentError(
      fmt::format("the frame is {} {}: {}", Length(tall ? box.sizes().y() : largest), tall ? "tall" : "wide",
                  unit.empty() ? "say the unit of its numbers with --units" : fmt::format("did you mean --units {}?", unit)));
}

absl::Status CheckAgreement(const std::vector<Vec3>& from_mesh, const std::vector<Vec3>& from_file) {
  std::int64_t against = 0;
  for (std::size_t i = 0; i < from_mesh.size(); ++i) against += from_mesh[i].dot(from_file[i]) < 0 ? 1 : 0;
  if (2 * against <= static_cast<std::int64_t>(from_mesh.size())) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{} of {} normals point against the triangles they belong to: turn the normals or the triangles round in the export, or export no "
                  "normals",
                  against, from_mesh.size()));
}

absl::Status CheckOutward(const RawFrame& raw) {
  const std::vector<Vec3>& positions = raw.mesh.vertices;
  if (!raw.is_mesh()) {
    const double outwardness = Outwardness(positions, raw.normals);
    if (outwardness >= kInward) return absl::OkStatus();
    return absl::InvalidArgumentError(
        fmt::format("the normals point inward (outwardness {:.2f}, where a person has about 0.25): turn them round in the export", outwardness));
  }
  std::vector<Vec3> centres;
  std::vector<Vec3> areas;
  for (const auto& t : raw.mesh.triangles) {
    const Vec3& a = positions[static_cast<std::size_t>(t[0])];
    const Vec3& b = positions[static_cast<std::size_t>(t[1])];
    const Vec3& c = positions[static_cast<std::size_t>(t[2])];
    centres.emplace_back((a + b + c) / 3);
    areas.emplace_back((b - a).cross(c - a));
  }
  // The flux of a closed surface does not depend on the centre, so that even a small negative one is certain.
  const double outwardness = Outwardness(centres, areas);
  if (outwardness >= 0 || (outwardness >= kInward && !geometry::IsClosed(raw.mesh))) return absl::OkStatus();
  return absl::InvalidArgumentError("the mesh is inside out (its triangles turn clockwise seen from outside): turn its faces round in the export");
}

}  // namespace vorocast::capture
