// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/hdf5_writer.h"

#include <algorithm>
#include <cstring>

#include <fmt/format.h>

namespace vorocast::storage {
namespace {

/// One buffer of equally long, zero-padded strings, as a fixed-length string type stores them.
std::string Pad(const std::vector<std::string>& values, std::size_t width) {
  std::string padded(values.size() * width, '\0');
  for (std::size_t i = 0; i < values.size(); ++i) std::memcpy(padded.data() + i * width, values[i].data(), values[i].size());
  return padded;
}

std::size_t Longest(const std::vector<std::string>& values) {
  std::size_t width = 1;
  for (const std::string& value : values) width = std::max(width, value.size());
  return width;
}

Hdf5Id Dataspace(const std::vector<hsize_t>& shape) {
  if (shape.empty()) return Hdf5Id(H5Screate(H5S_SCALAR));
  return Hdf5Id(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr));
}

}  // namespace

Hdf5Writer::Hdf5Writer(const std::filesystem::path& path) : path_(path) {
  SilenceHdf5();
  const Hdf5Id creation(H5Pcreate(H5P_FILE_CREATE));
  H5Pset_obj_track_times(creation.get(), false);
  const Hdf5Id access(H5Pcreate(H5P_FILE_ACCESS));
  H5Pset_libver_bounds(access.get(), H5F_LIBVER_V18, H5F_LIBVER_V110);
  file_ = Hdf5Id(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, creation.get(), access.get()));
  if (!file_.ok()) Fail("the file cannot be created");
}

void Hdf5Writer::Fail(const std::string& place) {
  if (status_.ok()) status_ = absl::UnavailableError(fmt::format("{}: {}: {}", path_.string(), place, Hdf5Error()));
}

void Hdf5Writer::Group(const std::string& name) {
  if (!status_.ok()) return;
  const Hdf5Id creation(H5Pcreate(H5P_GROUP_CREATE));
  H5Pset_obj_track_times(creation.get(), false);
  const Hdf5Id group(H5Gcreate2(file_.get(), name.c_str(), H5P_DEFAULT, creation.get(), H5P_DEFAULT));
  if (!group.ok()) Fail(name);
}

void Hdf5Writer::WriteDataset(const std::string& name, const std::vector<hsize_t>& shape, hid_t file_type, hid_t memory_type, const void* values) {
  if (!status_.ok()) return;
  const Hdf5Id creation(H5Pcreate(H5P_DATASET_CREATE));
  H5Pset_obj_track_times(creation.get(), false);
  H5Pset_layout(creation.get(), H5D_CONTIGUOUS);
  // Every byte is written below, so the fill values that HDF5 would write first are wasted.
  H5Pset_fill_time(creation.get(), H5D_FILL_TIME_NEVER);
  const Hdf5Id space = Dataspace(shape);
  const Hdf5Id dataset(H5Dcreate2(file_.get(), name.c_str(), file_type, space.get(), H5P_DEFAULT, creation.get(), H5P_DEFAULT));
  if (!dataset.ok()) return Fail(name);
  const bool empty = std::find(shape.begin(), shape.end(), 0) != shape.end();
  if (!empty && H5Dwrite(dataset.get(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0) Fail(name);
}

void Hdf5Writer::Strings(const std::string& name, const std::vector<std::string>& values) {
  const std::size_t width = Longest(values);
  const Hdf5Id type = FixedStringType(width);
  WriteDataset(name, {values.size()}, type.get(), type.get(), Pad(values, width).data());
}

void Hdf5Writer::WriteAttribute(const std::string& object, const std::string& name, hid_t file_type, hid_t memory_type,
                                const std::vector<hsize_t>& shape, const void* value) {
  if (!status_.ok()) return;
  const Hdf5Id owner(H5Oopen(file_.get(), object.c_str(), H5P_DEFAULT));
  const Hdf5Id space = Dataspace(shape);
  const Hdf5Id attribute(H5Acreate2(owner.get(), name.c_str(), file_type, space.get(), H5P_DEFAULT, H5P_DEFAULT));
  if (!attribute.ok()) return Fail(object + "@" + name);
  const bool empty = std::find(shape.begin(), shape.end(), 0) != shape.end();
  if (!empty && H5Awrite(attribute.get(), memory_type, value) < 0) Fail(object + "@" + name);
}

void Hdf5Writer::Attribute(const std::string& object, const std::string& name, const std::string& text) {
  const Hdf5Id type = FixedStringType(text.size());
  WriteAttribute(object, name, type.get(), type.get(), {}, Pad({text}, std::max<std::size_t>(text.size(), 1)).data());
}

void Hdf5Writer::Attribute(const std::string& object, const std::string& name, const std::vector<std::string>& list) {
  const std::size_t width = Longest(list);
  const Hdf5Id type = FixedStringType(width);
  WriteAttribute(object, name, type.get(), type.get(), {list.size()}, Pad(list, width).data());
}

absl::Status Hdf5Writer::Finish() {
  if (file_.ok() && status_.ok() && H5Fflush(file_.get(), H5F_SCOPE_GLOBAL) < 0) Fail("flushing failed");
  if (file_.ok() && H5Fclose(file_.Release()) < 0) Fail("closing failed");
  return status_;
}

}  // namespace vorocast::storage
