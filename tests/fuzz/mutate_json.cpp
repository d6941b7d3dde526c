// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/fuzz/mutate_json.h"

#include <algorithm>
#include <vector>

#include <nlohmann/json.hpp>

#include "tests/fuzz/mutate.h"

namespace vorocast::fuzz {
namespace {

using nlohmann::json;

/// Stands in a text for what the library could not write itself: a numeral of its own, or nesting that would exhaust its stack.
constexpr std::string_view kPlaceholder = "\x01";
constexpr int kDepthMax = 200;

bool IsDeep(const std::string& text) {
  int depth = 0;
  for (const char c : text) {
    depth += c == '[' || c == '{' ? 1 : c == ']' || c == '}' ? -1 : 0;
    if (depth > kDepthMax) return true;
  }
  return false;
}

/// All values of a document, outermost first.
void Collect(json& value, std::vector<json*>& values) {
  values.push_back(&value);
  if (!value.is_structured()) return;
  for (json& child : value) Collect(child, values);
}

json& Pick(json& document, base::Random& random) {
  std::vector<json*> values;
  Collect(document, values);
  return *values[random.Below(values.size())];
}

std::string Nested(base::Random& random) {
  const std::size_t depth = random.Below(16) != 0 ? 40 : 100'000;
  std::string text;
  if (random.Below(2) == 0) {
    text = std::string(depth, '[') + std::string(depth, ']');
  } else {
    for (std::size_t i = 0; i < depth; ++i) text += "{\"a\":";
    text += "1" + std::string(depth, '}');
  }
  return text;
}

/// What replaces a placeholder in the text.
std::string Unwritable(base::Random& random) { return random.Below(8) == 0 ? Nested(random) : AwkwardNumeral(random); }

json Awkward(base::Random& random) {
  switch (random.Below(10)) {
    case 0:
      return nullptr;
    case 1:
      return random.Below(2) == 0;
    case 2:
      return json::array();
    case 3:
      return json::object();
    case 4:
      return "";
    case 5:
      return std::string(1 + random.Below(2000), 'x');
    case 6:
      return std::string("a\0b\n\xC3\xA9\x7F", 8);
    case 7:
      return json::array({1, "two", nullptr});
    default:
      return std::string(kPlaceholder);
  }
}

void Change(json& value, const json& lent, base::Random& random) {
  if (value.is_object() && !value.empty() && random.Below(2) == 0) {
    const auto field = std::next(value.begin(), static_cast<std::ptrdiff_t>(random.Below(value.size())));
    const std::string name = field.key();
    json content = field.value();
    if (random.Below(2) == 0) {
      value.erase(name);
    } else {
      value[random.Below(2) == 0 ? name + "x" : std::string("\n")] = std::move(content);
    }
  } else if (value.is_array() && !value.empty() && random.Below(2) == 0) {
    const std::size_t at = random.Below(value.size());
    if (random.Below(2) == 0) {
      value.erase(at);
    } else {
      const json content = value[at];
      for (std::uint64_t i = 1 + random.Below(random.Below(20) == 0 ? 2000 : 4); i > 0; --i) value.push_back(content);
    }
  } else if (random.Below(4) == 0) {
    value = lent;
  } else if (value.is_number() && random.Below(2) == 0) {
    value = random.Below(2) == 0 ? json(-value.get<double>()) : json(std::string(kPlaceholder));
  } else {
    value = Awkward(random);
  }
}

}  // namespace

std::string MutateJson(const std::string& text, const std::string& other, base::Random& random) {
  if (IsDeep(text)) return text;
  json document = json::parse(text, nullptr, false);
  if (document.is_discarded()) return text;
  json lender = IsDeep(other) ? json() : json::parse(other, nullptr, false);
  const json lent = lender.is_discarded() ? json() : Pick(lender, random);
  Change(Pick(document, random), lent, random);
  std::string changed = document.dump(-1, ' ', false, json::error_handler_t::replace);
  constexpr std::string_view kWritten = "\"\\u0001\"";
  for (std::size_t at = changed.find(kWritten); at != std::string::npos; at = changed.find(kWritten, at)) {
    changed.replace(at, kWritten.size(), Unwritable(random));
  }
  return changed;
}

}  // namespace vorocast::fuzz
