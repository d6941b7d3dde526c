// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "services/geometry/rigid3.h"
#include "services/storage/hdf5_reader.h"
#include "services/storage/hdf5_writer.h"

/// Poses as the datasets `rotation` (w x y z) and `translation` (metres). Private to services/storage.
namespace vorocast::storage {

inline constexpr std::int64_t kPatchesMax = 1'000'000;

/// <group>/rotation [rows…,4] and <group>/translation [rows…,3], both f8.
void WritePoses(Hdf5Writer& writer, const std::string& group, std::vector<hsize_t> rows, const std::vector<geometry::Rigid3>& poses);
absl::StatusOr<std::vector<geometry::Rigid3>> ReadPoses(const Hdf5Reader& reader, const std::string& group, const Shape& rows);

/// /cells/rotation [rows…,4] and /cells/translation [rows…,3], both f4: there are many.
void WriteCellPoses(Hdf5Writer& writer, std::vector<hsize_t> rows, const std::vector<Eigen::Vector4f>& rotation,
                    const std::vector<geometry::Vec3>& translation);
absl::Status ReadCellPoses(const Hdf5Reader& reader, const Shape& rows, std::vector<Eigen::Vector4f>& rotation,
                           std::vector<geometry::Vec3>& translation);

}  // namespace vorocast::storage
