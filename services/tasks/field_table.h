// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <concepts>
#include <cstdint>
#include <initializer_list>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "services/base/status.h"

/// One description of an options struct serves both directions: a function `Describe(table, options)` names each field once, with what it may
/// hold, and is run with a FieldWriter to make JSON or a FieldReader to check and read it.
namespace vorocast::tasks {

/// Collects fields into a JSON object.
class FieldWriter {
 public:
  template <std::integral T>
  void Integer(const char* name, T& value, T, T) {
    json_[name] = value;
  }
  void Number(const char* name, double& value, double, double) { json_[name] = value; }
  void Choice(const char* name, std::string& value, std::initializer_list<std::string_view>) { json_[name] = value; }
  void Frames(const char* name, std::vector<std::int32_t>& value) { json_[name] = value; }
  void Object(const char* name, nlohmann::json& value) { json_[name] = value; }
  template <typename Options>
  void Nested(const char* name, Options& options) {
    FieldWriter inner;
    Describe(inner, options);
    json_[name] = inner.json();
  }

  const nlohmann::json& json() const { return json_; }

 private:
  nlohmann::json json_ = nlohmann::json::object();
};

/// Reads fields from a JSON object; a field that is absent keeps its default. The first wrong field decides the status.
class FieldReader {
 public:
  /// `place` is put before field names in messages: "options.".
  FieldReader(const nlohmann::json& json, std::string place);

  void Integer(const char* name, std::int32_t& value, std::int32_t low, std::int32_t high);
  void Integer(const char* name, std::uint64_t& value, std::uint64_t low, std::uint64_t high);
  void Number(const char* name, double& value, double low, double high);
  void Choice(const char* name, std::string& value, std::initializer_list<std::string_view> allowed);
  /// Ascending frame numbers, each once; at most kFramesMax.
  void Frames(const char* name, std::vector<std::int32_t>& value);
  /// Any object, of bounded size and depth.
  void Object(const char* name, nlohmann::json& value);
  template <typename Options>
  void Nested(const char* name, Options& options) {
    if (const nlohmann::json* field = Find(name)) {
      FieldReader inner(*field, place_ + name + ".");
      Describe(inner, options);
      if (status_.ok()) status_ = inner.Finish();
    }
  }

  /// The first error, or one for a field that nobody asked for.
  absl::Status Finish();

 private:
  const nlohmann::json* Find(const char* name);
  void Refuse(const char* name, const nlohmann::json& value, const std::string& must);

  const nlohmann::json& json_;
  std::string place_;
  std::set<std::string, std::less<>> known_;
  absl::Status status_;
};

inline constexpr std::int32_t kFrameNumberMax = 10'000'000;

/// Whether the value is a whole number from low to high. JSON numbers may be stored signed, unsigned or (1e3) as floating point; the last is refused.
template <typename T>
bool IsWholeIn(const nlohmann::json& value, T low, T high) {
  if (value.is_number_unsigned()) {
    const auto number = value.get<std::uint64_t>();
    return std::cmp_greater_equal(number, low) && std::cmp_less_equal(number, high);
  }
  if (!value.is_number_integer()) return false;
  const auto number = value.get<std::int64_t>();
  return std::cmp_greater_equal(number, low) && std::cmp_less_equal(number, high);
}

/// Whether the value nests at most `depth` deep; so that writing it out cannot exhaust the stack.
bool NestsWithin(const nlohmann::json& json, int depth);

}  // namespace vorocast::tasks
