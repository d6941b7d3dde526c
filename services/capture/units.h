// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>
#include <string_view>

#include "services/base/status.h"
#include "services/geometry/vector.h"

namespace vorocast::capture {

/// Turns vectors of a file into y up by a proper rotation (a multiple of 90° where "up" is another axis), exact to the last bit.
class UpRotation {
 public:
  /// "+y", "-y", "+z", …; INVALID_ARGUMENT lists them.
  static absl::StatusOr<UpRotation> Parse(const std::string& up);

  geometry::Vec3 operator*(const geometry::Vec3& v) const { return y_up_from_file_ * v; }
  const geometry::Mat3& Matrix() const { return y_up_from_file_; }

 private:
  explicit UpRotation(const geometry::Mat3& y_up_from_file) : y_up_from_file_(y_up_from_file) {}
  geometry::Mat3 y_up_from_file_;
};

/// "y" -> "+y"; INVALID_ARGUMENT lists the axes.
absl::StatusOr<std::string> NormaliseUp(const std::string& up);

/// The unit in which something of `size` (in the units of the file) would be as large as a person, "m", "cm", …; empty where none would.
std::string UnitOfPerson(double size);

}  // namespace vorocast::capture
