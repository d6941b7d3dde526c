// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/units.h"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "services/capture/capture.h"

namespace vorocast::capture {
namespace {

constexpr std::array<std::pair<std::string_view, double>, 5> kUnits = {{{"m", 1}, {"cm", 0.01}, {"mm", 0.001}, {"in", 0.0254}, {"ft", 0.3048}}};

}  // namespace

absl::StatusOr<double> MetresPerUnit(const std::string& unit) {
  for (const auto& [name, metres] : kUnits) {
    if (unit == name) return metres;
  }
  return absl::InvalidArgumentError(fmt::format("the unit '{}' is unknown: use m, cm, mm, in or ft", unit));
}

std::string UnitOfPerson(double size) {
  for (const auto& [name, metres] : kUnits) {
    if (size * metres > 1.0 && size * metres < 2.5) return std::string(name);
  }
  return "";
}

absl::StatusOr<std::string> NormaliseUp(const std::string& up) {
  const std::string normal = up.size() == 1 ? "+" + up : up;
  const bool valid = normal.size() == 2 && (normal[0] == '+' || normal[0] == '-') && normal[1] >= 'x' && normal[1] <= 'z';
  if (!valid) return absl::InvalidArgumentError(fmt::format("the up axis '{}' is unknown: use +x, -x, +y, -y, +z or -z", up));
  return normal;
}

absl::StatusOr<UpRotation> UpRotation::Parse(const std::string& up) {
  const absl::StatusOr<std::string> axis = NormaliseUp(up);
  if (!axis.ok()) return axis.status();
  const double sign = (*axis)[0] == '-' ? -1 : 1;
  geometry::Mat3 m;
  switch ((*axis)[1]) {
    case 'x':
      m << 0, -sign, 0, sign, 0, 0, 0, 0, 1;
      break;
    case 'y':
      m << 1, 0, 0, 0, sign, 0, 0, 0, sign;
      break;
    default:
      m << 1, 0, 0, 0, 0, sign, 0, -sign, 0;
  }
  return UpRotation(m);
}

}  // namespace vorocast::capture
