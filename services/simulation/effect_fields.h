// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "services/base/check.h"
#include "services/simulation/effect_settings.h"

namespace vorocast::simulation {

/// Reads the fields of one canonical object, whose presence and types the schema has checked already. On destruction every field must
/// have been read: a field that the schema has and the simulation ignores is a programmer's error.
class Fields {
 public:
  explicit Fields(const nlohmann::json& object) : object_(object) {}
  ~Fields() { VOROCAST_CHECK(read_.size() == object_.size()); }
  Fields(const Fields&) = delete;
  Fields& operator=(const Fields&) = delete;

  const nlohmann::json& Raw(const std::string& key) {
    const auto found = object_.find(key);
    VOROCAST_CHECK(found != object_.end());
    read_.insert(key);
    return *found;
  }
  template <typename T>
  T Get(const std::string& key) {
    return Raw(key).get<T>();
  }
  geometry::Vec3 PlainVector(const std::string& key) { return ToVector(Raw(key)); }
  /// A plain number, or key frames.
  Scalar KeyFramedNumber(const std::string& key) { return ToScalar(Raw(key)); }
  Vector KeyFramedVector(const std::string& key) {
    const nlohmann::json& value = Raw(key);
    if (!value[0].is_object()) return ToVector(value);
    std::vector<Vector::Key> keys;
    for (const nlohmann::json& one : value) keys.push_back({one.at("t").get<double>(), ToVector(one.at("value"))});
    return Vector(std::move(keys));
  }
  bool Is(const std::string& key, const char* word) { return Raw(key) == word; }
  /// Empty where the file has a word.
  std::optional<double> NumberOrWord(const std::string& key) {
    const nlohmann::json& value = Raw(key);
    return value.is_string() ? std::nullopt : std::optional<double>(value.get<double>());
  }
  std::optional<geometry::Vec3> VectorOrWord(const std::string& key) {
    const nlohmann::json& value = Raw(key);
    return value.is_string() ? std::nullopt : std::optional<geometry::Vec3>(ToVector(value));
  }
  std::optional<Scalar> KeyFramedOrWord(const std::string& key) {
    const nlohmann::json& value = Raw(key);
    return value.is_string() ? std::nullopt : std::optional<Scalar>(ToScalar(value));
  }
  std::optional<std::vector<std::int32_t>> NumbersOrWord(const std::string& key) {
    const nlohmann::json& value = Raw(key);
    return value.is_string() ? std::nullopt : std::optional(value.get<std::vector<std::int32_t>>());
  }
  std::array<double, 2> Range(const std::string& key) {
    const nlohmann::json& value = Raw(key);
    return {value[0].get<double>(), value[1].get<double>()};
  }
  Surface ReadSurface() { return {.friction = Get<double>("friction"), .restitution = Get<double>("restitution")}; }

 private:
  static Scalar ToScalar(const nlohmann::json& value) {
    if (value.is_number()) return value.get<double>();
    std::vector<Scalar::Key> keys;
    for (const nlohmann::json& key : value) keys.push_back({key.at("t").get<double>(), key.at("value").get<double>()});
    return Scalar(std::move(keys));
  }
  static geometry::Vec3 ToVector(const nlohmann::json& list) { return {list[0].get<double>(), list[1].get<double>(), list[2].get<double>()}; }

  const nlohmann::json& object_;
  std::set<std::string> read_;
};

MaskSettings ReadMask(const nlohmann::json& object);

}  // namespace vorocast::simulation
