// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "services/base/status.h"
#include "services/capture/frame_reader.h"

/// What makes a frame unusable, and which single points of a usable one are left out. Every refusal says what to do.
namespace vorocast::capture {

/// A normal shorter than this has no direction.
inline constexpr double kNormalLengthMin = 1e-6;

/// True for the positions to keep: finite, and within a thousand kilometres. Refuses more than 1 % of others.
absl::StatusOr<std::vector<bool>> CheckPositions(const std::vector<geometry::Vec3>& positions);
/// True for the normals to keep, which are unit or zero here. Refuses more than 1 % of zeros.
absl::StatusOr<std::vector<bool>> CheckNormals(const std::vector<geometry::Vec3>& normals);
/// Refuses extents above 50 m and below 1 cm, and tells a wrong unit from stray points. Positions in metres, y up.
absl::Status CheckSize(const std::vector<geometry::Vec3>& positions, double metres_per_unit);
/// Refuses normals of a file that mostly point against those of its own triangles.
absl::Status CheckAgreement(const std::vector<geometry::Vec3>& from_mesh, const std::vector<geometry::Vec3>& from_file);
/// Refuses a mesh that is inside out, and a cloud whose normals mostly point inward.
absl::Status CheckOutward(const RawFrame& raw);

}  // namespace vorocast::capture
