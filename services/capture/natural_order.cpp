// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/natural_order.h"

#include <algorithm>

namespace vorocast::capture {
namespace {

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

/// Takes the run of digits at the front, without its leading zeros.
std::string_view TakeDigits(std::string_view& text) {
  const auto end = static_cast<std::size_t>(std::ranges::find_if_not(text, IsDigit) - text.begin());
  std::string_view digits = text.substr(0, end);
  text.remove_prefix(end);
  digits.remove_prefix(std::min(digits.find_first_not_of('0'), digits.size()));
  return digits;
}

/// Numbers without leading zeros, of any length.
bool NumberLess(std::string_view a, std::string_view b) { return a.size() != b.size() ? a.size() < b.size() : a < b; }

}  // namespace

bool NaturalLess(std::string_view a, std::string_view b) {
  std::string_view rest_a = a;
  std::string_view rest_b = b;
  while (!rest_a.empty() && !rest_b.empty()) {
    if (IsDigit(rest_a[0]) && IsDigit(rest_b[0])) {
      const std::string_view number_a = TakeDigits(rest_a);
      const std::string_view number_b = TakeDigits(rest_b);
      if (number_a != number_b) return NumberLess(number_a, number_b);
      continue;
    }
    if (rest_a[0] != rest_b[0]) return static_cast<unsigned char>(rest_a[0]) < static_cast<unsigned char>(rest_b[0]);
    rest_a.remove_prefix(1);
    rest_b.remove_prefix(1);
  }
  if (rest_a.empty() != rest_b.empty()) return rest_a.empty();
  return a < b;
}

}  // namespace vorocast::capture
