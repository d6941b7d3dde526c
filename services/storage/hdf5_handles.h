// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <string>
#include <utility>

/// Private to services/storage: HDF5 identifiers that close themselves, and the library's error text.
namespace vorocast::storage {

/// Owns one HDF5 identifier of any kind. HDF5 counts references to files, groups, datasets, types and property lists alike.
class Hdf5Id {
 public:
  Hdf5Id() = default;
  explicit Hdf5Id(hid_t id) : id_(id) {}
  ~Hdf5Id() { Reset(); }
  Hdf5Id(Hdf5Id&& other) noexcept : id_(std::exchange(other.id_, H5I_INVALID_HID)) {}
  Hdf5Id& operator=(Hdf5Id&& other) noexcept {
    if (this != &other) {
      Reset();
      id_ = std::exchange(other.id_, H5I_INVALID_HID);
    }
    return *this;
  }

  bool ok() const { return id_ >= 0; }
  hid_t get() const { return id_; }
  /// Gives the identifier up; the caller closes it.
  hid_t Release() { return std::exchange(id_, H5I_INVALID_HID); }

 private:
  void Reset() {
    if (id_ >= 0) H5Idec_ref(id_);
    id_ = H5I_INVALID_HID;
  }
  hid_t id_ = H5I_INVALID_HID;
};

/// The HDF5 type of a C++ element: in memory, and as it is stored (always little-endian).
template <typename T>
struct Hdf5Type;
template <>
struct Hdf5Type<double> {
  static hid_t Memory() { return H5T_NATIVE_DOUBLE; }
  static hid_t File() { return H5T_IEEE_F64LE; }
};
template <>
struct Hdf5Type<float> {
  static hid_t Memory() { return H5T_NATIVE_FLOAT; }
  static hid_t File() { return H5T_IEEE_F32LE; }
};
template <>
struct Hdf5Type<std::uint8_t> {
  static hid_t Memory() { return H5T_NATIVE_UINT8; }
  static hid_t File() { return H5T_STD_U8LE; }
};
template <>
struct Hdf5Type<std::int32_t> {
  static hid_t Memory() { return H5T_NATIVE_INT32; }
  static hid_t File() { return H5T_STD_I32LE; }
};
template <>
struct Hdf5Type<std::int64_t> {
  static hid_t Memory() { return H5T_NATIVE_INT64; }
  static hid_t File() { return H5T_STD_I64LE; }
};
template <>
struct Hdf5Type<std::uint64_t> {
  static hid_t Memory() { return H5T_NATIVE_UINT64; }
  static hid_t File() { return H5T_STD_U64LE; }
};

/// Keeps HDF5 from printing to standard error in this thread. Called at every way in.
void SilenceHdf5();

/// What the library says of its last failure in this thread, innermost cause first; never empty.
std::string Hdf5Error();

/// A UTF-8 string type of exactly `bytes` bytes (at least one), padded with zeros.
Hdf5Id FixedStringType(std::size_t bytes);

}  // namespace vorocast::storage
