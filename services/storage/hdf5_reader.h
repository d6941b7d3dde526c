// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "services/base/status.h"
#include "services/storage/hdf5_handles.h"

namespace vorocast::storage {

/// A dataset's extent; kAny stands for a length that the file decides.
using Shape = std::vector<std::int64_t>;
inline constexpr std::int64_t kAny = -1;

/// Reads one HDF5 file without believing it. A dataset is read only when it is reached by hard links, is contiguous, has the expected type and
/// shape, and its bytes lie within the file: so nothing a file says can make the reader take more memory than the file has bytes (times the
/// widening of float to double). Errors are DATA_LOSS, or NOT_FOUND for the file itself, and name the file and the dataset. Not thread-safe.
class Hdf5Reader {
 public:
  static absl::StatusOr<Hdf5Reader> Open(const std::filesystem::path& path);

  bool Has(const std::string& name) const;

  /// The shape of a dataset of `Stored` elements, checked as the class comment says.
  template <typename Stored>
  absl::StatusOr<Shape> ShapeOf(const std::string& name, const Shape& expected) const {
    return CheckDataset(name, Hdf5Type<Stored>::File(), sizeof(Stored), expected);
  }

  /// All values in row-major order.
  template <typename Stored, typename T = Stored>
  absl::StatusOr<std::vector<T>> Dataset(const std::string& name, const Shape& expected) const {
    ASSIGN_OR_RETURN(const Shape shape, ShapeOf<Stored>(name, expected));
    std::vector<T> values(Count(shape));
    RETURN_IF_ERROR(ReadInto(name, Hdf5Type<T>::Memory(), values.empty() ? nullptr : values.data()));
    return values;
  }
  /// The same into elements that are `Fields` consecutive values of T (Eigen vectors): a dataset of shape [rows…, Fields].
  template <typename Stored, typename T, int Fields, typename Element>
  absl::StatusOr<std::vector<Element>> Rows(const std::string& name, Shape expected) const {
    static_assert(sizeof(Element) == Fields * sizeof(T));
    expected.push_back(Fields);
    ASSIGN_OR_RETURN(const Shape shape, ShapeOf<Stored>(name, expected));
    std::vector<Element> values(Count(shape) / Fields);
    RETURN_IF_ERROR(ReadInto(name, Hdf5Type<T>::Memory(), values.empty() ? nullptr : values.data()));
    return values;
  }
  absl::StatusOr<std::vector<std::string>> Strings(const std::string& name, const Shape& expected) const;

  template <typename T>
  absl::StatusOr<T> Attribute(const std::string& object, const std::string& name) const {
    T value{};
    RETURN_IF_ERROR(ReadScalarAttribute(object, name, Hdf5Type<T>::File(), Hdf5Type<T>::Memory(), &value));
    return value;
  }
  absl::StatusOr<std::string> TextAttribute(const std::string& object, const std::string& name) const;
  absl::StatusOr<std::vector<std::string>> ListAttribute(const std::string& object, const std::string& name) const;

  /// DATA_LOSS "path: place: what".
  absl::Status Wrong(const std::string& place, const std::string& what) const;

 private:
  Hdf5Reader() = default;
  static std::size_t Count(const Shape& shape);
  absl::Status CheckLinks(const std::string& name) const;
  absl::StatusOr<Shape> CheckDataset(const std::string& name, hid_t stored_type, std::size_t element_size, const Shape& expected) const;
  absl::Status ReadInto(const std::string& name, hid_t memory_type, void* values) const;
  absl::StatusOr<Hdf5Id> OpenAttribute(const std::string& object, const std::string& name) const;
  absl::Status ReadScalarAttribute(const std::string& object, const std::string& name, hid_t stored_type, hid_t memory_type, void* value) const;

  std::filesystem::path path_;
  std::uint64_t file_size_ = 0;
  Hdf5Id file_;
};

}  // namespace vorocast::storage
