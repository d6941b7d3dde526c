// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/json_schema.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <string_view>
#include <vector>

#include "services/base/check.h"
#include "services/tasks/field_table.h"

namespace vorocast::simulation {
namespace {

using nlohmann::json;

std::string Join(const std::vector<std::string>& words) { return fmt::format("{}", fmt::join(words, ", ")); }

/// A value as a message shows it: short, and never invalid UTF-8. Writing it out recurses as deep as it nests, which a client decides.
std::string Show(const json& value) {
  constexpr std::size_t kLongest = 60;
  constexpr int kDeepest = 32;
  if (!tasks::NestsWithin(value, kDeepest)) return fmt::format("what nests more than {} deep", kDeepest);
  std::string text = value.dump(-1, ' ', true, json::error_handler_t::replace);
  if (text.size() > kLongest) text = text.substr(0, kLongest) + "…";
  return text;
}

class Checker {
 public:
  Checker(const json& schema, std::string subject) : root_(schema), subject_(std::move(subject)) {}

  absl::StatusOr<json> Check(const json& schema_or_ref, const json& value, const std::string& path) const {
    const json& schema = Resolve(schema_or_ref);
    if (schema.contains("oneOf")) return CheckTagged(schema, value, path);
    if (IsKeyFramed(schema)) return CheckKeyFramed(schema, value, path);
    if (schema.contains("anyOf")) return CheckWordOr(schema, value, path);
    if (schema.contains("const")) return value == schema["const"] ? absl::StatusOr<json>(value) : Wrong(schema, value, path);
    if (schema.contains("enum")) return CheckEnum(schema, value, path);
    const std::string type = schema.at("type");
    if (type == "object") return CheckObject(schema, value, path);
    if (type == "array") return CheckArray(schema, value, path);
    if (type == "number") return CheckNumber(schema, value, path);
    if (type == "integer") return CheckInteger(schema, value, path);
    if (type == "string") return CheckString(schema, value, path);
    VOROCAST_CHECK(type == "boolean");
    return value.is_boolean() ? absl::StatusOr<json>(value) : Wrong(schema, value, path);
  }

 private:
  const json& Resolve(const json& schema) const {
    // "allOf" around a reference is how draft-07 gives one a default of its own.
    if (const auto all = schema.find("allOf"); all != schema.end()) return Resolve(all->at(0));
    const auto ref = schema.find("$ref");
    if (ref == schema.end()) return schema;
    return root_.at(json::json_pointer(ref->get<std::string>().substr(1)));
  }
  /// What a property is when it is left out, or null when it must not be.
  const json* Default(const json& property) const {
    const json& owner = property.contains("allOf") ? property : Resolve(property);
    const auto found = owner.find("default");
    return found == owner.end() ? nullptr : &*found;
  }

  absl::Status Error(const std::string& path, const std::string& text) const {
    return absl::InvalidArgumentError(path.empty() ? fmt::format("{}: {}", subject_, text) : fmt::format("{}: {}: {}", subject_, path, text));
  }
  absl::Status Wrong(const json& schema, const json& value, const std::string& path) const {
    return Error(path, fmt::format("{} is not {}", Show(value), Describe(schema)));
  }

  /// What a field may hold, in words.
  std::string Describe(const json& schema_or_ref) const {
    const json& schema = Resolve(schema_or_ref);
    if (schema.contains("const")) return Show(schema["const"]);
    if (schema.contains("enum")) return fmt::format("one of {}", Join(schema["enum"].get<std::vector<std::string>>()));
    if (IsKeyFramed(schema)) return fmt::format("{} or a list of key frames", Describe(schema["anyOf"][0]));
    if (schema.contains("anyOf")) return fmt::format("{} or {}", Describe(schema["anyOf"][0]), Describe(schema["anyOf"][1]));
    if (schema.contains("oneOf")) return fmt::format("an object whose {} is one of {}", TagName(schema), Join(TagValues(schema)));
    const std::string type = schema.at("type");
    if (type == "object") return "an object";
    if (type == "boolean") return "true or false";
    if (type == "string") return fmt::format("a text of {} to {} characters", schema.value("minLength", 0), schema.at("maxLength").get<int>());
    if (type == "array") {
      const int fewest = schema.value("minItems", 0);
      const int most = schema.at("maxItems").get<int>();
      return fmt::format("a list of {} items", fewest == most ? fmt::format("{}", most) : fmt::format("{} to {}", fewest, most));
    }
    if (schema.contains("exclusiveMinimum")) {
      return fmt::format("a number above {} and up to {}", schema["exclusiveMinimum"].get<double>(), schema.at("maximum").get<double>());
    }
    if (type == "integer")
      return fmt::format("a whole number from {} to {}", schema.at("minimum").get<std::int64_t>(), schema.at("maximum").get<std::int64_t>());
    return fmt::format("a number from {} to {}", schema.at("minimum").get<double>(), schema.at("maximum").get<double>());
  }

  absl::StatusOr<json> CheckNumber(const json& schema, const json& value, const std::string& path) const {
    if (!value.is_number()) return Wrong(schema, value, path);
    const double number = value.get<double>();
    const bool above =
        schema.contains("exclusiveMinimum") ? number > schema["exclusiveMinimum"].get<double>() : number >= schema.at("minimum").get<double>();
    if (!above || !(number <= schema.at("maximum").get<double>())) return Wrong(schema, value, path);
    return json(number == 0 ? 0.0 : number);  // −0 and 0 are one effect, and have one key.
  }

  absl::StatusOr<json> CheckInteger(const json& schema, const json& value, const std::string& path) const {
    if (!value.is_number_integer()) return Wrong(schema, value, path);
    // Compared as a real number first: an unsigned number may not fit a signed one.
    const auto number = value.get<double>();
    if (!(number >= schema.at("minimum").get<double>()) || !(number <= schema.at("maximum").get<double>())) return Wrong(schema, value, path);
    return json(value.get<std::int64_t>());
  }

  absl::StatusOr<json> CheckString(const json& schema, const json& value, const std::string& path) const {
    if (!value.is_string()) return Wrong(schema, value, path);
    const std::string& text = value.get_ref<const std::string&>();
    std::size_t characters = 0;
    for (const char c : text) characters += (static_cast<unsigned char>(c) & 0xC0) != 0x80;
    if (characters < schema.value("minLength", std::size_t{0}) || characters > schema.at("maxLength").get<std::size_t>())
      return Wrong(schema, value, path);
    return value;
  }

  absl::StatusOr<json> CheckEnum(const json& schema, const json& value, const std::string& path) const {
    for (const json& allowed : schema["enum"]) {
      if (value == allowed) return value;
    }
    return Error(path, fmt::format("{} is none of {}", Show(value), Join(schema["enum"].get<std::vector<std::string>>())));
  }

  absl::StatusOr<json> CheckArray(const json& schema, const json& value, const std::string& path) const {
    if (!value.is_array() || value.size() < schema.value("minItems", std::size_t{0}) || value.size() > schema.at("maxItems").get<std::size_t>()) {
      return Wrong(schema, value, path);
    }
    json result = json::array();
    for (std::size_t i = 0; i < value.size(); ++i) {
      ASSIGN_OR_RETURN(json item, Check(schema.at("items"), value[i], fmt::format("{}[{}]", path, i)));
      result.push_back(std::move(item));
    }
    return result;
  }

  absl::StatusOr<json> CheckObject(const json& schema, const json& value, const std::string& path) const {
    if (!value.is_object()) return Wrong(schema, value, path);
    const json& properties = schema.at("properties");
    const auto below = [&](const std::string& key) { return path.empty() ? key : path + "." + key; };
    for (const auto& [key, unused] : value.items()) {
      if (properties.contains(key)) continue;
      std::vector<std::string> known;
      for (const auto& [name, property] : properties.items()) known.push_back(name);
      return Error(below(Show(key)), fmt::format("there is no such field; there are {}", Join(known)));
    }
    json result = json::object();
    for (const auto& [key, property] : properties.items()) {
      const json* fallback = Default(property);
      const auto found = value.find(key);
      if (found == value.end() && fallback == nullptr) return Error(below(key), fmt::format("missing; it must be {}", Describe(property)));
      ASSIGN_OR_RETURN(json field, Check(property, found == value.end() ? *fallback : *found, below(key)));
      result[key] = std::move(field);
    }
    return result;
  }

  /// anyOf of a number or a point, and key frames of it.
  bool IsKeyFramed(const json& schema) const { return schema.contains("anyOf") && !Resolve(schema["anyOf"][0]).contains("const"); }
  absl::StatusOr<json> CheckKeyFramed(const json& schema, const json& value, const std::string& path) const {
    const json& plain = schema["anyOf"][0];
    const bool has_keys = value.is_array() && !value.empty() && value[0].is_object();
    if (!has_keys) {
      auto constant = Check(plain, value, path);
      const bool is_point = value.is_array() && Resolve(plain).at("type") == "array";
      return constant.ok() || is_point ? constant : Wrong(schema, value, path);
    }
    ASSIGN_OR_RETURN(json keys, Check(schema["anyOf"][1], value, path));
    for (std::size_t i = 0; i < keys.size(); ++i) {
      const std::string key_path = fmt::format("{}[{}]", path, i);
      ASSIGN_OR_RETURN(keys[i]["value"], Check(plain, value[i]["value"], key_path + ".value"));
      if (i > 0 && !(keys[i]["t"] > keys[i - 1]["t"])) {
        return Error(key_path + ".t", fmt::format("{} is not later than the key frame before, {}", Show(keys[i]["t"]), Show(keys[i - 1]["t"])));
      }
    }
    return keys;
  }

  /// anyOf of a word and something else: "auto" or a number.
  absl::StatusOr<json> CheckWordOr(const json& schema, const json& value, const std::string& path) const {
    VOROCAST_CHECK(schema["anyOf"].size() == 2);
    const json& word = Resolve(schema["anyOf"][0]).at("const");
    if (value == word) return value;
    // A list is meant as the list: its own message tells more.
    const bool other_is_object = Resolve(schema["anyOf"][1]).value("type", "") == "object";
    if (value.is_string() || value.is_object() != other_is_object) return Wrong(schema, value, path);
    auto other = Check(schema["anyOf"][1], value, path);
    if (!other.ok() && !value.is_array() && !other_is_object) return Wrong(schema, value, path);
    return other;
  }

  /// The property that tells the alternatives of a oneOf apart: the one that is const in the first.
  std::string TagName(const json& schema) const {
    for (const auto& [key, property] : Resolve(schema["oneOf"][0]).at("properties").items()) {
      if (property.contains("const")) return key;
    }
    VOROCAST_CHECK(false);
  }
  std::vector<std::string> TagValues(const json& schema) const {
    const std::string tag = TagName(schema);
    std::vector<std::string> values;
    for (const json& alternative : schema["oneOf"]) values.push_back(Resolve(alternative)["properties"][tag]["const"]);
    return values;
  }
  absl::StatusOr<json> CheckTagged(const json& schema, const json& value, const std::string& path) const {
    if (!value.is_object()) return Wrong(schema, value, path);
    const std::string tag = TagName(schema);
    const std::vector<std::string> values = TagValues(schema);
    if (!value.contains(tag)) return Error(path + "." + tag, fmt::format("missing; it must be one of {}", Join(values)));
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (value[tag] == values[i]) return CheckObject(Resolve(schema["oneOf"][i]), value, path);
    }
    return Error(path + "." + tag, fmt::format("{} is none of {}", Show(value[tag]), Join(values)));
  }

  const json& root_;
  const std::string subject_;
};

}  // namespace

absl::StatusOr<json> Canonicalise(const json& schema, const json& value, const std::string& subject) {
  return Checker(schema, subject).Check(schema, value, "");
}

}  // namespace vorocast::simulation
