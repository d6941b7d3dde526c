// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/fuzz/mutate.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "tests/fuzz/mutate_json.h"

namespace vorocast::fuzz {
namespace {

constexpr std::size_t kChunkMax = 64;

std::size_t Place(const std::string& text, base::Random& random) { return random.Below(text.size() + 1); }

void ChangeBytes(std::string& text, const std::vector<std::string>& others, base::Random& random) {
  if (text.empty()) text.push_back(static_cast<char>(random.Bits()));
  const std::size_t at = random.Below(text.size());
  const std::size_t length = 1 + random.Below(std::min(kChunkMax, text.size() - at));
  switch (random.Below(8)) {
    case 0:
      text[at] = static_cast<char>(text[at] ^ (1 << random.Below(8)));
      break;
    case 1:
      text[at] = static_cast<char>(random.Bits());
      break;
    case 2:
      text.erase(at, length);
      break;
    case 3:
      text.insert(Place(text, random), text.substr(at, length));
      break;
    case 4:
      text.resize(at);
      break;
    case 5: {
      // A binary number blown up, of either byte order.
      std::uint64_t value = AwkwardInteger(random);
      const std::size_t width = std::min<std::size_t>(std::size_t{1} << random.Below(4), text.size() - at);
      if (random.Below(2) == 0) value = __builtin_bswap64(value);
      std::memcpy(text.data() + at, &value, width);
      break;
    }
    case 6: {
      const std::string& other = others[random.Below(others.size())];
      const std::size_t from = Place(other, random);
      text.replace(at, length, other, from, 1 + random.Below(kChunkMax));
      break;
    }
    default: {
      const std::string& other = others[random.Below(others.size())];
      text = text.substr(0, at) + other.substr(Place(other, random));
      break;
    }
  }
}

bool IsNumeral(char c) { return (c >= '0' && c <= '9') || c == '.' || c == '-' || c == '+'; }

/// Replaces one of the numbers in a text.
void ChangeNumber(std::string& text, base::Random& random) {
  const auto digit = [](char c) { return c >= '0' && c <= '9'; };
  const std::size_t start = text.empty() ? 0 : random.Below(text.size());
  auto found = std::find_if(text.begin() + static_cast<std::ptrdiff_t>(start), text.end(), digit);
  if (found == text.end()) found = std::find_if(text.begin(), text.end(), digit);
  if (found == text.end()) return;
  auto begin = found;
  while (begin != text.begin() && IsNumeral(*(begin - 1))) --begin;
  const auto end = std::find_if_not(found, text.end(), IsNumeral);
  text.replace(begin, end, AwkwardNumeral(random));
}

void ChangeOnce(std::string& text, const std::vector<std::string>& others, Form form, base::Random& random) {
  const bool as_bytes = random.Below(4) == 0;
  if (form == Form::kText && !as_bytes && random.Below(2) == 0) return ChangeNumber(text, random);
  if (form == Form::kJson && !as_bytes) {
    text = MutateJson(text, others[random.Below(others.size())], random);
  } else {
    ChangeBytes(text, others, random);
  }
}

}  // namespace

std::string AwkwardNumeral(base::Random& random) {
  static const char* const kNumerals[] = {"0",
                                          "-0",
                                          "-1",
                                          "1",
                                          "2",
                                          "0.5",
                                          "255",
                                          "65536",
                                          "1000000",
                                          "10000000",
                                          "2147483647",
                                          "2147483648",
                                          "-2147483649",
                                          "4294967295",
                                          "4294967296",
                                          "9223372036854775807",
                                          "9223372036854775808",
                                          "-9223372036854775808",
                                          "18446744073709551615",
                                          "18446744073709551616",
                                          "1e-320",
                                          "1e9",
                                          "1e19",
                                          "1e300",
                                          "-1e300",
                                          "1e400",
                                          "1.7976931348623157e308",
                                          "nan",
                                          "inf",
                                          "-inf",
                                          "0x10",
                                          "00012",
                                          "1e",
                                          "123456789012345678901234567890123456789012345678901234567890"};
  return kNumerals[random.Below(std::size(kNumerals))];
}

std::uint64_t AwkwardInteger(base::Random& random) {
  switch (random.Below(4)) {
    case 0:
      return random.Below(4) - 2;  // −2 … 1 in every width
    case 1:
      return (std::uint64_t{1} << random.Below(64)) - random.Below(2);
    case 2:
      return random.Bits() >> random.Below(64);
    default:
      return random.Below(2) == 0 ? 0x7f7f7f7f7f7f7f7fULL : 0x8080808080808080ULL;
  }
}

double AwkwardDouble(base::Random& random) {
  using Limits = std::numeric_limits<double>;
  constexpr double kDoubles[] = {0,
                                 -0.0,
                                 1,
                                 -1,
                                 1e-320,
                                 1e-9,
                                 0.5,
                                 1e5,
                                 1e19,
                                 1e300,
                                 -1e300,
                                 Limits::max(),
                                 Limits::lowest(),
                                 Limits::infinity(),
                                 -Limits::infinity(),
                                 Limits::quiet_NaN()};
  return kDoubles[random.Below(std::size(kDoubles))];
}

std::string Mutate(std::string input, const std::vector<std::string>& others, Form form, std::size_t size_max, base::Random& random) {
  for (std::uint64_t changes = 1 + random.Below(4); changes > 0; --changes) ChangeOnce(input, others, form, random);
  if (input.size() > size_max) input.resize(size_max);
  return input;
}

}  // namespace vorocast::fuzz
