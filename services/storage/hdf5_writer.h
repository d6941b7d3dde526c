// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "services/base/status.h"
#include "services/storage/hdf5_handles.h"

namespace vorocast::storage {

/// Writes one HDF5 file whose bytes depend only on the calls made: no time stamps, fixed format bounds, contiguous datasets in call order.
/// The first failure is kept and every later call does nothing; Finish() returns it. Not thread-safe.
class Hdf5Writer {
 public:
  /// Creates the file; an existing one is overwritten.
  explicit Hdf5Writer(const std::filesystem::path& path);

  /// "/cells": its parent must exist.
  void Group(const std::string& name);

  /// `values` in row-major order of `shape`. Stored as `Stored`, which HDF5 converts to when it differs (double to float).
  template <typename Stored, typename T>
  void Dataset(const std::string& name, const std::vector<hsize_t>& shape, const T* values) {
    WriteDataset(name, shape, Hdf5Type<Stored>::File(), Hdf5Type<T>::Memory(), values);
  }
  /// A list of strings, each padded to the longest.
  void Strings(const std::string& name, const std::vector<std::string>& values);

  /// On the group or dataset `object`.
  template <typename T>
  void Attribute(const std::string& object, const std::string& name, T value) {
    WriteAttribute(object, name, Hdf5Type<T>::File(), Hdf5Type<T>::Memory(), {}, &value);
  }
  void Attribute(const std::string& object, const std::string& name, const std::string& text);
  void Attribute(const std::string& object, const std::string& name, const std::vector<std::string>& list);

  /// Flushes and closes. INTERNAL (a programmer's error in the calls) or UNAVAILABLE (the file could not be written), with path and place.
  absl::Status Finish();

 private:
  void WriteDataset(const std::string& name, const std::vector<hsize_t>& shape, hid_t file_type, hid_t memory_type, const void* values);
  void WriteAttribute(const std::string& object, const std::string& name, hid_t file_type, hid_t memory_type, const std::vector<hsize_t>& shape,
                      const void* value);
  void Fail(const std::string& place);

  std::filesystem::path path_;
  Hdf5Id file_;
  absl::Status status_;
};

}  // namespace vorocast::storage
