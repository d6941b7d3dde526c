// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/hdf5_reader.h"

#include <cstring>
#include <system_error>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace vorocast::storage {
namespace {

std::string Describe(const Shape& shape) {
  std::vector<std::string> lengths;
  for (const std::int64_t length : shape) lengths.push_back(length == kAny ? "any" : std::to_string(length));
  return fmt::format("[{}]", fmt::join(lengths, ","));
}

/// Splits a buffer of zero-padded strings.
std::vector<std::string> Unpad(const std::string& padded, std::size_t width) {
  std::vector<std::string> values;
  for (std::size_t begin = 0; begin + width <= padded.size(); begin += width) {
    values.emplace_back(padded.data() + begin, strnlen(padded.data() + begin, width));
  }
  return values;
}

/// Appends the extent of a simple or scalar dataspace to `shape`; false unless its product fits into 62 bits.
bool ExtentOf(hid_t space, Shape& shape) {
  const int rank = H5Sget_simple_extent_ndims(space);
  if (rank < 0 || H5Sget_simple_extent_type(space) == H5S_NULL) return false;
  std::vector<hsize_t> lengths(static_cast<std::size_t>(rank));
  if (rank > 0 && H5Sget_simple_extent_dims(space, lengths.data(), nullptr) < 0) return false;
  std::uint64_t product = 1;
  for (const hsize_t length : lengths) {
    if (length > (1ULL << 40) || (length > 0 && product > (1ULL << 62) / length)) return false;
    product *= length == 0 ? 1 : length;
    shape.push_back(static_cast<std::int64_t>(length));
  }
  return true;
}

bool Matches(const Shape& shape, const Shape& expected) {
  if (shape.size() != expected.size()) return false;
  for (std::size_t i = 0; i < shape.size(); ++i) {
    if (expected[i] != kAny && shape[i] != expected[i]) return false;
  }
  return true;
}

}  // namespace

absl::StatusOr<Hdf5Reader> Hdf5Reader::Open(const std::filesystem::path& path) {
  SilenceHdf5();
  std::error_code error;
  Hdf5Reader reader;
  reader.path_ = path;
  reader.file_size_ = std::filesystem::file_size(path, error);
  if (error) return absl::NotFoundError(fmt::format("{}: cannot be opened: {}", path.string(), error.message()));
  reader.file_ = Hdf5Id(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
  if (!reader.file_.ok()) return absl::DataLossError(fmt::format("{}: is not a whole HDF5 file: {}", path.string(), Hdf5Error()));
  return reader;
}

absl::Status Hdf5Reader::Wrong(const std::string& place, const std::string& what) const {
  return absl::DataLossError(fmt::format("{}: {}: {}", path_.string(), place, what));
}

std::size_t Hdf5Reader::Count(const Shape& shape) {
  std::size_t count = 1;
  for (const std::int64_t length : shape) count *= static_cast<std::size_t>(length);
  return count;
}

bool Hdf5Reader::Has(const std::string& name) const { return CheckLinks(name).ok(); }

/// Soft and external links could lead out of the file, or round in circles.
absl::Status Hdf5Reader::CheckLinks(const std::string& name) const {
  for (std::size_t end = name.find('/', 1);; end = name.find('/', end + 1)) {
    const std::string prefix = name.substr(0, end);
    H5L_info_t link;
    if (H5Lget_info(file_.get(), prefix.c_str(), &link, H5P_DEFAULT) < 0) return Wrong(name, "is missing");
    if (link.type != H5L_TYPE_HARD) return Wrong(name, "is reached by a link that is not part of the format");
    if (end == std::string::npos) return absl::OkStatus();
  }
}

absl::StatusOr<Shape> Hdf5Reader::CheckDataset(const std::string& name, hid_t stored_type, std::size_t element_size, const Shape& expected) const {
  RETURN_IF_ERROR(CheckLinks(name));
  const Hdf5Id dataset(H5Dopen2(file_.get(), name.c_str(), H5P_DEFAULT));
  if (!dataset.ok()) return Wrong(name, "is not a dataset that can be opened: " + Hdf5Error());
  if (stored_type != H5I_INVALID_HID) {
    const Hdf5Id type(H5Dget_type(dataset.get()));
    if (H5Tequal(type.get(), stored_type) <= 0) return Wrong(name, "has another element type than the format says");
  }
  const Hdf5Id creation(H5Dget_create_plist(dataset.get()));
  if (H5Pget_layout(creation.get()) != H5D_CONTIGUOUS || H5Pget_external_count(creation.get()) != 0) {
    return Wrong(name, "is not stored contiguously within the file");
  }
  const Hdf5Id space(H5Dget_space(dataset.get()));
  Shape shape;
  if (!ExtentOf(space.get(), shape) || !Matches(shape, expected)) {
    return Wrong(name, fmt::format("has shape {} where {} is expected", Describe(shape), Describe(expected)));
  }
  const std::size_t count = Count(shape);
  if (count == 0) return shape;
  const haddr_t begin = H5Dget_offset(dataset.get());
  const bool small = count <= file_size_ / element_size;
  const bool within = small && H5Dget_storage_size(dataset.get()) == count * element_size && begin <= file_size_ - count * element_size;
  if (!within) return Wrong(name, fmt::format("{} values of {} bytes do not lie within the file of {} bytes", count, element_size, file_size_));
  return shape;
}

absl::Status Hdf5Reader::ReadInto(const std::string& name, hid_t memory_type, void* values) const {
  if (!values) return absl::OkStatus();
  const Hdf5Id dataset(H5Dopen2(file_.get(), name.c_str(), H5P_DEFAULT));
  if (H5Dread(dataset.get(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0) return Wrong(name, "cannot be read: " + Hdf5Error());
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::string>> Hdf5Reader::Strings(const std::string& name, const Shape& expected) const {
  RETURN_IF_ERROR(CheckLinks(name));
  const Hdf5Id dataset(H5Dopen2(file_.get(), name.c_str(), H5P_DEFAULT));
  if (!dataset.ok()) return Wrong(name, "is not a dataset that can be opened: " + Hdf5Error());
  const Hdf5Id type(H5Dget_type(dataset.get()));
  if (H5Tget_class(type.get()) != H5T_STRING || H5Tis_variable_str(type.get()) != 0) return Wrong(name, "does not hold fixed-length strings");
  const std::size_t width = H5Tget_size(type.get());
  ASSIGN_OR_RETURN(const Shape shape, CheckDataset(name, H5I_INVALID_HID, width, expected));
  std::string padded(Count(shape) * width, '\0');
  RETURN_IF_ERROR(ReadInto(name, type.get(), padded.empty() ? nullptr : padded.data()));
  return Unpad(padded, width);
}

absl::StatusOr<Hdf5Id> Hdf5Reader::OpenAttribute(const std::string& object, const std::string& name) const {
  if (object != "/") RETURN_IF_ERROR(CheckLinks(object));
  Hdf5Id attribute(H5Aopen_by_name(file_.get(), object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT));
  if (!attribute.ok()) return Wrong(object + "@" + name, "is missing");
  if (H5Aget_storage_size(attribute.get()) > file_size_) return Wrong(object + "@" + name, "is larger than the file");
  return attribute;
}

absl::Status Hdf5Reader::ReadScalarAttribute(const std::string& object, const std::string& name, hid_t stored_type, hid_t memory_type,
                                             void* value) const {
  ASSIGN_OR_RETURN(const Hdf5Id attribute, OpenAttribute(object, name));
  const Hdf5Id type(H5Aget_type(attribute.get()));
  const Hdf5Id space(H5Aget_space(attribute.get()));
  if (H5Tequal(type.get(), stored_type) <= 0 || H5Sget_simple_extent_npoints(space.get()) != 1) {
    return Wrong(object + "@" + name, "has another type or shape than the format says");
  }
  if (H5Aread(attribute.get(), memory_type, value) < 0) return Wrong(object + "@" + name, "cannot be read: " + Hdf5Error());
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::string>> Hdf5Reader::ListAttribute(const std::string& object, const std::string& name) const {
  ASSIGN_OR_RETURN(const Hdf5Id attribute, OpenAttribute(object, name));
  const Hdf5Id type(H5Aget_type(attribute.get()));
  const Hdf5Id space(H5Aget_space(attribute.get()));
  if (H5Tget_class(type.get()) != H5T_STRING || H5Tis_variable_str(type.get()) != 0) {
    return Wrong(object + "@" + name, "is not a fixed-length string");
  }
  const std::size_t width = H5Tget_size(type.get());
  Shape shape;
  if (!ExtentOf(space.get(), shape) || Count(shape) > file_size_ / width) return Wrong(object + "@" + name, "is larger than the file");
  std::string padded(Count(shape) * width, '\0');
  if (!padded.empty() && H5Aread(attribute.get(), type.get(), padded.data()) < 0) return Wrong(object + "@" + name, "cannot be read: " + Hdf5Error());
  return Unpad(padded, width);
}

absl::StatusOr<std::string> Hdf5Reader::TextAttribute(const std::string& object, const std::string& name) const {
  ASSIGN_OR_RETURN(std::vector<std::string> list, ListAttribute(object, name));
  if (list.size() != 1) return Wrong(object + "@" + name, "is not one string");
  return std::move(list.front());
}

}  // namespace vorocast::storage
