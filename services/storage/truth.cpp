// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/truth.h"

#include <fmt/format.h>
#include <hdf5.h>

#include <array>
#include <system_error>

namespace vorocast::storage {
namespace {

/// Closes an HDF5 identifier with the call of its kind.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;

  operator hid_t() const { return id_; }  // NOLINT(google-explicit-constructor): passed to the C interface everywhere
  bool ok() const { return id_ >= 0; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

/// Keeps HDF5 from printing its own error stack while alive: errors come back as statuses.
class QuietErrors {
 public:
  QuietErrors() {
    H5Eget_auto2(H5E_DEFAULT, &function_, &client_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~QuietErrors() { H5Eset_auto2(H5E_DEFAULT, function_, client_); }
  QuietErrors(const QuietErrors&) = delete;
  QuietErrors& operator=(const QuietErrors&) = delete;

 private:
  H5E_auto2_t function_ = nullptr;
  void* client_ = nullptr;
};

absl::Status Bad(const std::filesystem::path& path, const char* dataset, const char* reason) {
  return absl::DataLossError(fmt::format("{}: {}: {}", path.string(), dataset, reason));
}

absl::Status CannotWrite(const std::filesystem::path& path, const char* what) {
  return absl::UnavailableError(fmt::format("{}: cannot write {}; is the disk full?", path.string(), what));
}

template <std::size_t N>
absl::Status WriteDataset(const std::filesystem::path& path, hid_t file, const char* name, const std::array<hsize_t, N>& shape, hid_t file_type,
                          hid_t memory_type, const void* values) {
  const Handle space(H5Screate_simple(N, shape.data(), nullptr), H5Sclose);
  const Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_obj_track_times(properties, false);  // no time stamps: the same content is the same bytes
  H5Pset_layout(properties, H5D_CONTIGUOUS);
  H5Pset_alloc_time(properties, H5D_ALLOC_TIME_EARLY);
  const Handle set(H5Dcreate2(file, name, file_type, space, H5P_DEFAULT, properties, H5P_DEFAULT), H5Dclose);
  if (!set.ok() || H5Dwrite(set, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0) return CannotWrite(path, name);
  return absl::OkStatus();
}

/// Opens a dataset of the expected type class and rank whose values lie in the file itself, all of them.
template <std::size_t N>
absl::Status CheckDataset(const std::filesystem::path& path, hid_t set, const char* name, H5T_class_t type_class, std::uintmax_t file_size,
                          std::array<hsize_t, N>& shape) {
  if (set < 0) return Bad(path, name, "is missing");
  const Handle type(H5Dget_type(set), H5Tclose);
  const Handle space(H5Dget_space(set), H5Sclose);
  const Handle properties(H5Dget_create_plist(set), H5Pclose);
  if (H5Tget_class(type) != type_class) return Bad(path, name, "holds values of another type");
  if (H5Sget_simple_extent_ndims(space) != static_cast<int>(N)) return Bad(path, name, "has another number of dimensions");
  H5Sget_simple_extent_dims(space, shape.data(), nullptr);
  if (H5Pget_layout(properties) != H5D_CONTIGUOUS || H5Pget_external_count(properties) != 0)
    return Bad(path, name, "is not stored in one piece in this file");
  std::uintmax_t bytes = H5Tget_size(type);
  for (const hsize_t length : shape) {
    if (length != 0 && bytes > file_size / length) return Bad(path, name, "claims more values than the file holds");
    bytes *= length;
  }
  if (bytes > 0 && H5Dget_storage_size(set) != bytes) return Bad(path, name, "is cut short");
  return absl::OkStatus();
}

absl::StatusOr<double> ReadRate(const std::filesystem::path& path, hid_t file) {
  constexpr const char* kName = "attribute frames_per_second";
  const Handle attribute(H5Aopen(file, "frames_per_second", H5P_DEFAULT), H5Aclose);
  if (!attribute.ok()) return Bad(path, kName, "is missing");
  const Handle space(H5Aget_space(attribute), H5Sclose);
  const Handle type(H5Aget_type(attribute), H5Tclose);
  if (H5Sget_simple_extent_npoints(space) != 1 || H5Tget_class(type) != H5T_FLOAT) return Bad(path, kName, "is not one number");
  double rate = 0;
  if (H5Aread(attribute, H5T_NATIVE_DOUBLE, &rate) < 0) return Bad(path, kName, "cannot be read");
  if (!(rate > 0 && rate <= 1e6)) return Bad(path, kName, "is no frame rate");
  return rate;
}

}  // namespace

absl::Status WriteTruth(const std::filesystem::path& path, const Truth& truth) {
  std::vector<double> points;
  points.reserve(truth.points.size() * truth.part.size() * 3);
  for (std::size_t frame = 0; frame < truth.points.size(); ++frame) {
    if (truth.points[frame].size() != truth.part.size()) {
      return absl::InvalidArgumentError(
          fmt::format("{}: frame {} has {} points for {} parts", path.string(), frame, truth.points[frame].size(), truth.part.size()));
    }
    for (const geometry::Vec3& x : truth.points[frame]) points.insert(points.end(), x.data(), x.data() + 3);
  }
  if (points.empty()) return absl::InvalidArgumentError(fmt::format("{}: a truth needs at least one frame and one point", path.string()));

  const QuietErrors quiet;
  const Handle file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose);
  if (!file.ok()) return CannotWrite(path, "the file");
  const Handle scalar(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle rate(H5Acreate2(file, "frames_per_second", H5T_IEEE_F64LE, scalar, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  if (!rate.ok() || H5Awrite(rate, H5T_NATIVE_DOUBLE, &truth.frames_per_second) < 0) return CannotWrite(path, "frames_per_second");
  const std::array<hsize_t, 3> shape = {truth.points.size(), truth.part.size(), 3};
  RETURN_IF_ERROR(WriteDataset(path, file, "/points", shape, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, points.data()));
  RETURN_IF_ERROR(WriteDataset(path, file, "/part", std::array<hsize_t, 1>{truth.part.size()}, H5T_STD_I32LE, H5T_NATIVE_INT32, truth.part.data()));
  if (H5Fflush(file, H5F_SCOPE_LOCAL) < 0) return CannotWrite(path, "its last bytes");
  return absl::OkStatus();
}

absl::StatusOr<Truth> ReadTruth(const std::filesystem::path& path) {
  std::error_code error;
  const std::uintmax_t file_size = std::filesystem::file_size(path, error);
  if (error) return absl::NotFoundError(fmt::format("{}: {}", path.string(), error.message()));
  const QuietErrors quiet;
  const Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!file.ok()) return Bad(path, "file", "is not a readable HDF5 file");
  const Handle points(H5Dopen2(file, "/points", H5P_DEFAULT), H5Dclose);
  const Handle part(H5Dopen2(file, "/part", H5P_DEFAULT), H5Dclose);
  std::array<hsize_t, 3> shape{};
  std::array<hsize_t, 1> parts{};
  RETURN_IF_ERROR(CheckDataset(path, points, "/points", H5T_FLOAT, file_size, shape));
  RETURN_IF_ERROR(CheckDataset(path, part, "/part", H5T_INTEGER, file_size, parts));
  if (shape[2] != 3 || shape[1] != parts[0]) return Bad(path, "/points", "is not [F,k,3] with the k of /part");

  Truth truth;
  ASSIGN_OR_RETURN(truth.frames_per_second, ReadRate(path, file));
  std::vector<double> values(shape[0] * shape[1] * 3);
  truth.part.resize(parts[0]);
  if (H5Dread(points, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) return Bad(path, "/points", "cannot be read");
  if (H5Dread(part, H5T_NATIVE_INT32, H5S_ALL, H5S_ALL, H5P_DEFAULT, truth.part.data()) < 0) return Bad(path, "/part", "cannot be read");
  const double* value = values.data();
  for (hsize_t frame = 0; frame < shape[0]; ++frame) {
    std::vector<geometry::Vec3>& row = truth.points.emplace_back();
    row.reserve(shape[1]);
    for (hsize_t i = 0; i < shape[1]; ++i, value += 3) row.emplace_back(value[0], value[1], value[2]);
  }
  return truth;
}

}  // namespace vorocast::storage
