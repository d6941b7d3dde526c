// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/effect_settings.h"

#include <fmt/format.h>

#include <set>

#include "services/base/check.h"
#include "services/simulation/effect_fields.h"

namespace vorocast::simulation {
namespace {

using geometry::Vec3;
using nlohmann::json;

GroundSettings ReadGround(const json& object) {
  Fields fields(object);
  return {.enabled = fields.Get<bool>("enabled"), .height_m = fields.NumberOrWord("height_m"), .surface = fields.ReadSurface()};
}

RecallSettings ReadRecall(const json& object) {
  Fields fields(object);
  return {.stiffness_s2 = fields.KeyFramedNumber("stiffness_s2"),
          .damping_ratio = fields.KeyFramedNumber("damping_ratio"),
          .angular_stiffness_s2 = fields.KeyFramedNumber("angular_stiffness_s2"),
          .angular_damping_ratio = fields.KeyFramedNumber("angular_damping_ratio"),
          .weight_carried = fields.KeyFramedNumber("weight_carried"),
          .mask = ReadMask(fields.Raw("mask"))};
}

CellSettings ReadCells(const json& object) {
  Fields fields(object);
  return {.density_kg_m3 = fields.Get<double>("density_kg_m3"), .shrink_m = fields.Get<double>("shrink_m"), .surface = fields.ReadSurface()};
}

ReleaseRule ReadRelease(const json& object) {
  Fields fields(object);
  ReleaseRule rule{.vanish = fields.Is("action", "vanish"), .vanish_s = fields.Get<double>("vanish_s"), .mask = ReadMask(fields.Raw("mask"))};
  const auto start_s = fields.Get<double>("start_s");
  if (fields.Is("by", "height")) {
    rule.by = ReleaseByHeight{
        .from_top = fields.Is("from", "top"), .start_s = start_s, .end_s = fields.Get<double>("end_s"), .share = fields.Get<double>("share")};
  } else if (fields.Is("by", "depth")) {
    rule.by = ReleaseByDepth{.from_outside = fields.Is("from", "outside"), .start_s = start_s, .speed_m_s = fields.KeyFramedNumber("speed_m_s")};
  } else {
    VOROCAST_CHECK(fields.Is("by", "heat"));
    rule.by = ReleaseByHeat{.start_s = start_s,
                            .source = ReadMask(fields.Raw("source")),
                            .held = fields.Get<bool>("held"),
                            .geometric = fields.Is("weights", "geometric"),
                            .rate_s = fields.KeyFramedNumber("rate_s"),
                            .threshold = fields.Get<double>("threshold")};
  }
  return rule;
}

Placement::Motion ReadMotion(Fields& fields) {
  if (fields.Is("motion", "driven")) return Placement::Motion::kDriven;
  return fields.Is("motion", "fixed") ? Placement::Motion::kFixed : Placement::Motion::kLoose;
}

Placement ReadPlacement(Fields& fields) {
  return {.name = fields.Get<std::string>("name"),
          .position_m = fields.KeyFramedVector("position_m"),
          .rotation_deg = fields.KeyFramedVector("rotation_deg"),
          .origin_is_take = fields.Is("origin", "take"),
          .motion = ReadMotion(fields),
          .mass_kg = fields.Get<double>("mass_kg"),
          .velocity_m_s = fields.PlainVector("velocity_m_s"),
          .start_s = fields.Get<double>("start_s"),
          .surface = fields.ReadSurface()};
}

/// A box whose place is given by the middle of its foot.
BoxSettings ReadWall(Fields& fields) {
  const Vec3 size(fields.Get<double>("thickness_m"), fields.Get<double>("height_m"), fields.Get<double>("width_m"));
  std::vector<Vector::Key> keys = fields.KeyFramedVector("position_m").keys();
  for (Vector::Key& key : keys) key.value.y() += 0.5 * size.y();
  return {.placement = {.name = fields.Get<std::string>("name"),
                        .position_m = Vector(std::move(keys)),
                        .rotation_deg = Vec3(0, -fields.Get<double>("heading_deg"), 0),
                        .origin_is_take = fields.Is("origin", "take"),
                        .motion = ReadMotion(fields),
                        .surface = fields.ReadSurface()},
          .size_m = size};
}

MeshSettings ReadMesh(Fields& fields) {
  MeshSettings mesh{.placement = ReadPlacement(fields), .scale = fields.Get<double>("scale")};
  fields.Raw("file");  // empty by now: CheckTogether refuses it otherwise
  for (const json& v : fields.Raw("vertices")) mesh.mesh.vertices.emplace_back(v[0].get<double>(), v[1].get<double>(), v[2].get<double>());
  for (const json& t : fields.Raw("triangles")) mesh.mesh.triangles.push_back(t.get<std::array<std::int32_t, 3>>());
  return mesh;
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
  if (kind == "box") return BoxSettings{.placement = ReadPlacement(fields), .size_m = fields.PlainVector("size_m")};
  if (kind == "sphere") return SphereSettings{.placement = ReadPlacement(fields), .radius_m = fields.Get<double>("radius_m")};
  if (kind == "wall") return ReadWall(fields);
  if (kind == "mesh") return ReadMesh(fields);
  VOROCAST_CHECK(kind == "pendulum");
  return ReadPendulum(fields);
}

FieldSettings ReadField(const json& object) {
  Fields fields(object);
  FieldSettings field{.acts_on_recalled = fields.Is("acts_on", "all"), .mask = ReadMask(fields.Raw("mask"))};
  if (fields.Is("kind", "attractor")) {
    field.kind = AttractorSettings{.position_m = fields.KeyFramedVector("position_m"),
                                   .origin_is_take = fields.Is("origin", "take"),
                                   .strength_m_s2 = fields.KeyFramedNumber("strength_m_s2"),
                                   .reach_m = fields.Get<double>("reach_m"),
                                   .drag_s = fields.KeyFramedNumber("drag_s")};
  } else {
    VOROCAST_CHECK(fields.Is("kind", "wind"));
    field.kind = WindSettings{.velocity_m_s = fields.KeyFramedVector("velocity_m_s"),
                              .drag_s = fields.KeyFramedNumber("drag_s"),
                              .turbulence = fields.KeyFramedNumber("turbulence"),
                              .turbulence_size_m = fields.Get<double>("turbulence_size_m")};
  }
  return field;
}

DistortionSettings ReadDistortion(const json& object) {
  Fields fields(object);
  DistortionSettings distortion{.mask = ReadMask(fields.Raw("mask"))};
  if (fields.Is("kind", "twist")) {
    distortion.kind =
        TwistSettings{.angle_deg = fields.KeyFramedNumber("angle_deg"), .from_m = fields.Get<double>("from_m"), .to_m = fields.Get<double>("to_m")};
  } else if (fields.Is("kind", "swell")) {
    distortion.kind = SwellSettings{.horizontal = fields.KeyFramedNumber("horizontal"), .vertical = fields.KeyFramedNumber("vertical")};
  } else {
    VOROCAST_CHECK(fields.Is("kind", "wave"));
    distortion.kind = WaveSettings{.amplitude_m = fields.KeyFramedVector("amplitude_m"),
                                   .along = fields.PlainVector("along"),
                                   .length_m = fields.Get<double>("length_m"),
                                   .frequency_hz = fields.KeyFramedNumber("frequency_hz")};
  }
  return distortion;
}

BondSettings ReadBonds(const json& object) {
  using Between = BondSettings::Between;
  Fields fields(object);
  return {.between = fields.Is("between", "all")        ? Between::kAll
                     : fields.Is("between", "released") ? Between::kReleased
                                                        : Between::kNone,
          .stiffness_s2 = fields.KeyFramedNumber("stiffness_s2"),
          .damping_ratio = fields.KeyFramedNumber("damping_ratio"),
          .break_stretch = fields.KeyFramedOrWord("break_stretch"),
          .mask = ReadMask(fields.Raw("mask"))};
}

std::optional<MorphSettings> ReadMorph(const json& word_or_object) {
  if (word_or_object.is_string()) return std::nullopt;
  using Order = MorphSettings::Order;
  Fields fields(word_or_object);
  return MorphSettings{.order = fields.Is("order", "outside_in")   ? Order::kOutsideIn
                                : fields.Is("order", "inside_out") ? Order::kInsideOut
                                : fields.Is("order", "top_down")   ? Order::kTopDown
                                : fields.Is("order", "bottom_up")  ? Order::kBottomUp
                                                                   : Order::kTogether,
                       .start_s = fields.Get<double>("start_s"),
                       .end_s = fields.Get<double>("end_s"),
                       .cell_s = fields.Get<double>("cell_s"),
                       .target_start_s = fields.Get<double>("target_start_s"),
                       .order_weight_m = fields.Get<double>("order_weight_m")};
}

PersistenceSettings ReadPersistence(const json& object) {
  using From = PersistenceSettings::From;
  Fields fields(object);
  return {.start_s = fields.Get<double>("start_s"),
          .end_s = fields.Get<double>("end_s"),
          .interval_s = fields.Get<double>("interval_s"),
          .lifetime_s = fields.Get<double>("lifetime_s"),
          .speed = fields.KeyFramedNumber("speed"),
          .drift_m_s = fields.KeyFramedVector("drift_m_s"),
          .erode_from = fields.Is("erode_from", "outside")  ? From::kOutside
                        : fields.Is("erode_from", "inside") ? From::kInside
                        : fields.Is("erode_from", "top")    ? From::kTop
                                                            : From::kBottom,
          .erode_start_s = fields.Get<double>("erode_start_s"),
          .vanish_s = fields.Get<double>("vanish_s"),
          .mask = ReadMask(fields.Raw("mask"))};
}

RuptureSettings ReadRupture(const json& object) {
  Fields fields(object);
  return {.acceleration_m_s2 = fields.KeyFramedOrWord("acceleration_m_s2"), .mask = ReadMask(fields.Raw("mask"))};
}

absl::Status CheckMesh(const json& object, const std::string& path) {
  if (!object.at("file").get<std::string>().empty()) {
    return absl::InvalidArgumentError(fmt::format(
        "effect: {}.file: a file is read where an effect is loaded by its name or path; what is sent on has vertices and triangles", path));
  }
  const std::size_t corners = object.at("vertices").size();
  if (object.at("triangles").empty())
    return absl::InvalidArgumentError(fmt::format("effect: {}: a mesh needs a file, or vertices and triangles", path));
  for (const json& triangle : object.at("triangles")) {
    for (const json& corner : triangle) {
      if (corner.get<std::size_t>() < corners) continue;
      return absl::InvalidArgumentError(fmt::format("effect: {}.triangles: corner {} is not there; there are {}", path, corner.dump(), corners));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckObjects(const json& objects) {
  std::set<std::string> names;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const json& object = objects[i];
    const std::string path = fmt::format("objects[{}]", i);
    const std::string name = object.at("name");
    if (!names.insert(name).second) {
      return absl::InvalidArgumentError(fmt::format("effect: {}.name: \"{}\" is another object's name already; give each its own", path, name));
    }
    for (const char* field : {"position_m", "rotation_deg"}) {
      if (!object.contains(field) || !object[field][0].is_object() || object.at("motion") == "driven") continue;
      return absl::InvalidArgumentError(
          fmt::format("effect: {}.motion: key frames in {} move only what is \"driven\", not {}", path, field, object["motion"].dump()));
    }
    if (object.at("kind") == "mesh") RETURN_IF_ERROR(CheckMesh(object, path));
  }
  return absl::OkStatus();
}

absl::Status CheckTogether(const json& effect) {
  const json& release = effect.at("release");
  for (std::size_t i = 0; i < release.size(); ++i) {
    if (!release[i].contains("end_s")) continue;
    const double start = release[i].at("start_s");
    const double end = release[i].at("end_s");
    if (end < start) return absl::InvalidArgumentError(fmt::format("effect: release[{}].end_s: {} is before start_s, {}", i, end, start));
  }
  const json& morph = effect.at("morph");
  if (morph.is_object() && morph["end_s"] < morph["start_s"]) {
    return absl::InvalidArgumentError(fmt::format("effect: morph.end_s: {} is before start_s, {}", morph["end_s"].dump(), morph["start_s"].dump()));
  }
  for (std::size_t i = 0; i < effect.at("distortion").size(); ++i) {
    const json& distortion = effect["distortion"][i];
    if (distortion.contains("to_m") && !(distortion["to_m"] > distortion["from_m"]))
      return absl::InvalidArgumentError(fmt::format("effect: distortion[{}].to_m: {} is not above from_m", i, distortion["to_m"].dump()));
    if (distortion.contains("along") && distortion["along"] == json({0.0, 0.0, 0.0}))
      return absl::InvalidArgumentError(fmt::format("effect: distortion[{}].along: it has no direction", i));
  }
  return CheckObjects(effect.at("objects"));
}

}  // namespace

MaskSettings ReadMask(const json& object) {
  Fields fields(object);
  MaskSettings mask{.components = fields.NumbersOrWord("components"),
                    .patches = fields.NumbersOrWord("patches"),
                    .height = fields.Range("height"),
                    .height_soft = fields.Get<double>("height_soft"),
                    .depth_m = fields.Range("depth_m"),
                    .depth_soft_m = fields.Get<double>("depth_soft_m"),
                    .invert = fields.Get<bool>("invert")};
  for (const json& ball : fields.Raw("painted")) {
    Fields painted(ball);
    mask.painted.push_back(
        {.position_m = painted.PlainVector("position_m"), .radius_m = painted.Get<double>("radius_m"), .soft_m = painted.Get<double>("soft_m")});
  }
  return mask;
}

absl::StatusOr<Effect> EffectFromCanonicalJson(const json& json_effect) {
  RETURN_IF_ERROR(CheckTogether(json_effect));
  Fields fields(json_effect);
  Effect effect{.name = fields.Get<std::string>("name"),
                .description = fields.Get<std::string>("description"),
                .duration_s = fields.NumberOrWord("duration_s"),
                .duration_min_s = fields.Get<double>("duration_min_s"),
                .output_fps = fields.NumberOrWord("output_fps"),
                .rate_hz = fields.Get<double>("rate_hz"),
                .gravity_m_s2 = fields.KeyFramedNumber("gravity_m_s2"),
                .ground = ReadGround(fields.Raw("ground")),
                .recall = ReadRecall(fields.Raw("recall")),
                .rupture = ReadRupture(fields.Raw("rupture")),
                .cells = ReadCells(fields.Raw("cells"))};
  for (const json& rule : fields.Raw("release")) effect.release.push_back(ReadRelease(rule));
  effect.morph = ReadMorph(fields.Raw("morph"));
  effect.bonds = ReadBonds(fields.Raw("bonds"));
  for (const json& copies : fields.Raw("persistence")) effect.persistence.push_back(ReadPersistence(copies));
  for (const json& field : fields.Raw("fields")) effect.fields.push_back(ReadField(field));
  for (const json& distortion : fields.Raw("distortion")) effect.distortion.push_back(ReadDistortion(distortion));
  for (const json& object : fields.Raw("objects")) effect.objects.push_back(ReadObject(object));
  return effect;
}

}  // namespace vorocast::simulation
