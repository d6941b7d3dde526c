// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/effect_settings.h"

#include <fmt/format.h>

#include <set>

#include "services/base/check.h"

namespace vorocast::simulation {
namespace {

using geometry::Vec3;
using nlohmann::json;

/// Reads the fields of one canonical object, whose presence and types the schema has checked already. On destruction every field must
/// have been read: a field that the schema has and the simulation ignores is a programmer's error.
class Fields {
 public:
  explicit Fields(const json& object) : object_(object) {}
  ~Fields() { VOROCAST_CHECK(read_.size() == object_.size()); }
  Fields(const Fields&) = delete;
  Fields& operator=(const Fields&) = delete;

  const json& Raw(const std::string& key) {
    const auto found = object_.find(key);
    VOROCAST_CHECK(found != object_.end());
    read_.insert(key);
    return *found;
  }
  template <typename T>
  T Get(const std::string& key) {
    return Raw(key).get<T>();
  }
  Vec3 Vector(const std::string& key) { return ToVector(Raw(key)); }
  bool Is(const std::string& key, const char* word) { return Raw(key) == word; }
  /// Empty where the file has a word.
  std::optional<double> NumberOrWord(const std::string& key) {
    const json& value = Raw(key);
    return value.is_string() ? std::nullopt : std::optional<double>(value.get<double>());
  }
  std::optional<Vec3> VectorOrWord(const std::string& key) {
    const json& value = Raw(key);
    return value.is_string() ? std::nullopt : std::optional<Vec3>(ToVector(value));
  }
  Surface ReadSurface() { return {.friction = Get<double>("friction"), .restitution = Get<double>("restitution")}; }

 private:
  static Vec3 ToVector(const json& list) { return {list[0].get<double>(), list[1].get<double>(), list[2].get<double>()}; }

  const json& object_;
  std::set<std::string> read_;
};

GroundSettings ReadGround(const json& object) {
  Fields fields(object);
  return {.enabled = fields.Get<bool>("enabled"), .height_m = fields.NumberOrWord("height_m"), .surface = fields.ReadSurface()};
}

RecallSettings ReadRecall(const json& object) {
  Fields fields(object);
  return {.stiffness_s2 = fields.Get<double>("stiffness_s2"),
          .damping_ratio = fields.Get<double>("damping_ratio"),
          .angular_stiffness_s2 = fields.Get<double>("angular_stiffness_s2"),
          .angular_damping_ratio = fields.Get<double>("angular_damping_ratio")};
}

CellSettings ReadCells(const json& object) {
  Fields fields(object);
  return {.density_kg_m3 = fields.Get<double>("density_kg_m3"), .shrink_m = fields.Get<double>("shrink_m"), .surface = fields.ReadSurface()};
}

ReleaseByHeight ReadRelease(const json& object) {
  Fields fields(object);
  VOROCAST_CHECK(fields.Is("by", "height"));
  return {.from_top = fields.Is("from", "top"),
          .start_s = fields.Get<double>("start_s"),
          .end_s = fields.Get<double>("end_s"),
          .share = fields.Get<double>("share")};
}

Placement ReadPlacement(Fields& fields) {
  return {.name = fields.Get<std::string>("name"),
          .position_m = fields.Vector("position_m"),
          .origin_is_take = fields.Is("origin", "take"),
          .fixed = fields.Is("motion", "fixed"),
          .mass_kg = fields.Get<double>("mass_kg"),
          .velocity_m_s = fields.Vector("velocity_m_s"),
          .start_s = fields.Get<double>("start_s"),
          .surface = fields.ReadSurface()};
}

PendulumSettings ReadPendulum(Fields& fields) {
  return {.name = fields.Get<std::string>("name"),
          .radius_m = fields.Get<double>("radius_m"),
          .arm_m = fields.Get<double>("arm_m"),
          .pivot_m = fields.VectorOrWord("pivot_m"),
          .origin_is_take = fields.Is("origin", "take"),
          .heading_deg = fields.NumberOrWord("heading_deg"),
          .start_angle_deg = fields.Get<double>("start_angle_deg"),
          .hit_time_s = fields.Get<double>("hit_time_s"),
          .hit_height = fields.Get<double>("hit_height"),
          .driven = fields.Is("motion", "driven"),
          .mass_kg = fields.Get<double>("mass_kg"),
          .surface = fields.ReadSurface()};
}

ObjectSettings ReadObject(const json& object) {
  Fields fields(object);
  const auto kind = fields.Get<std::string>("kind");
  if (kind == "box")
    return BoxSettings{.placement = ReadPlacement(fields), .size_m = fields.Vector("size_m"), .rotation_deg = fields.Vector("rotation_deg")};
  if (kind == "sphere") return SphereSettings{.placement = ReadPlacement(fields), .radius_m = fields.Get<double>("radius_m")};
  VOROCAST_CHECK(kind == "pendulum");
  return ReadPendulum(fields);
}

std::optional<double> ReadRupture(const json& object) {
  Fields fields(object);
  return fields.NumberOrWord("acceleration_m_s2");
}

absl::Status CheckTogether(const json& effect) {
  const json& release = effect.at("release");
  for (std::size_t i = 0; i < release.size(); ++i) {
    const double start = release[i].at("start_s");
    const double end = release[i].at("end_s");
    if (end < start) return absl::InvalidArgumentError(fmt::format("effect: release[{}].end_s: {} is before start_s, {}", i, end, start));
  }
  std::set<std::string> names;
  for (std::size_t i = 0; i < effect.at("objects").size(); ++i) {
    const std::string name = effect["objects"][i].at("name");
    if (!names.insert(name).second) {
      return absl::InvalidArgumentError(fmt::format("effect: objects[{}].name: \"{}\" is another object's name already; give each its own", i, name));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Effect> EffectFromCanonicalJson(const json& json_effect) {
  RETURN_IF_ERROR(CheckTogether(json_effect));
  Fields fields(json_effect);
  Effect effect{.name = fields.Get<std::string>("name"),
                .description = fields.Get<std::string>("description"),
                .duration_s = fields.NumberOrWord("duration_s"),
                .duration_min_s = fields.Get<double>("duration_min_s"),
                .output_fps = fields.NumberOrWord("output_fps"),
                .rate_hz = fields.Get<double>("rate_hz"),
                .gravity_m_s2 = fields.Get<double>("gravity_m_s2"),
                .ground = ReadGround(fields.Raw("ground")),
                .recall = ReadRecall(fields.Raw("recall")),
                .rupture_acceleration_m_s2 = ReadRupture(fields.Raw("rupture")),
                .cells = ReadCells(fields.Raw("cells"))};
  for (const json& rule : fields.Raw("release")) effect.release.push_back(ReadRelease(rule));
  for (const json& object : fields.Raw("objects")) effect.objects.push_back(ReadObject(object));
  return effect;
}

}  // namespace vorocast::simulation
