// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/truth.h"

#include <algorithm>

#include <fmt/format.h>

#include "services/storage/hdf5_reader.h"
#include "services/storage/hdf5_writer.h"

namespace vorocast::storage {

using geometry::Vec3;

absl::Status WriteTruth(const std::filesystem::path& path, const Truth& truth) {
  const std::size_t count = truth.part.size();
  std::vector<Vec3> points;
  points.reserve(truth.points.size() * count);
  for (std::size_t frame = 0; frame < truth.points.size(); ++frame) {
    if (truth.points[frame].size() != count) {
      return absl::InvalidArgumentError(
          fmt::format("{}: frame {} has {} points for {} parts", path.string(), frame, truth.points[frame].size(), count));
    }
    points.insert(points.end(), truth.points[frame].begin(), truth.points[frame].end());
  }
  if (points.empty()) return absl::InvalidArgumentError(fmt::format("{}: a truth needs at least one frame and one point", path.string()));

  Hdf5Writer file(path);
  file.Attribute("/", "frames_per_second", truth.frames_per_second);
  file.Dataset<double>("/points", {truth.points.size(), count, 3}, points.front().data());
  file.Dataset<std::int32_t>("/part", {count}, truth.part.data());
  return file.Finish();
}

absl::StatusOr<Truth> ReadTruth(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const Hdf5Reader file, Hdf5Reader::Open(path));
  Truth truth;
  ASSIGN_OR_RETURN(truth.frames_per_second, file.Attribute<double>("/", "frames_per_second"));
  if (!(truth.frames_per_second > 0 && truth.frames_per_second <= 1e6)) return file.Wrong("/frames_per_second", "is no frame rate");
  ASSIGN_OR_RETURN(truth.part, file.Dataset<std::int32_t>("/part", {kAny}));
  const auto count = static_cast<std::int64_t>(truth.part.size());
  if (count == 0) return file.Wrong("/part", "holds no point");
  ASSIGN_OR_RETURN(const std::vector<Vec3> points, (file.Rows<double, double, 3, Vec3>("/points", {kAny, count})));
  const auto finite = [](const Vec3& point) { return point.allFinite(); };
  if (!std::all_of(points.begin(), points.end(), finite)) return file.Wrong("/points", "a value is not finite");
  for (auto row = points.begin(); row != points.end(); row += count) truth.points.emplace_back(row, row + count);
  return truth;
}

}  // namespace vorocast::storage
