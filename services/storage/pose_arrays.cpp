// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/pose_arrays.h"

namespace vorocast::storage {

using geometry::Quat;
using geometry::Rigid3;
using geometry::Vec3;

namespace {

std::vector<hsize_t> With(std::vector<hsize_t> rows, hsize_t last) {
  rows.push_back(last);
  return rows;
}

}  // namespace

void WritePoses(Hdf5Writer& writer, const std::string& group, std::vector<hsize_t> rows, const std::vector<Rigid3>& poses) {
  std::vector<double> rotation;
  std::vector<double> translation;
  rotation.reserve(4 * poses.size());
  translation.reserve(3 * poses.size());
  for (const Rigid3& pose : poses) {
    rotation.insert(rotation.end(), {pose.rotation.w(), pose.rotation.x(), pose.rotation.y(), pose.rotation.z()});
    translation.insert(translation.end(), pose.translation.begin(), pose.translation.end());
  }
  writer.Dataset<double>(group + "/rotation", With(rows, 4), rotation.data());
  writer.Dataset<double>(group + "/translation", With(rows, 3), translation.data());
}

absl::StatusOr<std::vector<Rigid3>> ReadPoses(const Hdf5Reader& reader, const std::string& group, const Shape& rows) {
  ASSIGN_OR_RETURN(const auto rotation, (reader.Rows<double, double, 4, Eigen::Vector4d>(group + "/rotation", rows)));
  ASSIGN_OR_RETURN(const auto translation, (reader.Rows<double, double, 3, Vec3>(group + "/translation", rows)));
  std::vector<Rigid3> poses(rotation.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    poses[i] = {Quat(rotation[i][0], rotation[i][1], rotation[i][2], rotation[i][3]), translation[i]};
  }
  return poses;
}

void WriteCellPoses(Hdf5Writer& writer, std::vector<hsize_t> rows, const std::vector<Eigen::Vector4f>& rotation,
                    const std::vector<Vec3>& translation) {
  writer.Dataset<float>("/cells/rotation", With(rows, 4), reinterpret_cast<const float*>(rotation.data()));
  writer.Dataset<float>("/cells/translation", With(rows, 3), reinterpret_cast<const double*>(translation.data()));
}

absl::Status ReadCellPoses(const Hdf5Reader& reader, const Shape& rows, std::vector<Eigen::Vector4f>& rotation, std::vector<Vec3>& translation) {
  ASSIGN_OR_RETURN(rotation, (reader.Rows<float, float, 4, Eigen::Vector4f>("/cells/rotation", rows)));
  ASSIGN_OR_RETURN(translation, (reader.Rows<float, double, 3, Vec3>("/cells/translation", rows)));
  return absl::OkStatus();
}

}  // namespace vorocast::storage
