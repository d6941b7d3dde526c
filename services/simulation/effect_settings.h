// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <nlohmann/json.hpp>

#include "services/base/status.h"
#include "services/geometry/triangle_mesh.h"
#include "services/geometry/vector.h"
#include "services/simulation/bonds.h"
#include "services/simulation/distortion.h"
#include "services/simulation/force_fields.h"
#include "services/simulation/key_framed.h"
#include "services/simulation/mask.h"
#include "services/simulation/morph.h"
#include "services/simulation/persistence.h"

/// A whole effect in types. Every member is a field of effects/effect.schema.json, whose descriptions hold; what the file writes as a
/// word ("take", "auto", "lowest", "never") is an empty optional here.
namespace vorocast::simulation {

struct Surface {
  double friction = 0.7;
  double restitution = 0.1;
};

struct GroundSettings {
  bool enabled = true;
  std::optional<double> height_m;
  Surface surface;
};

struct RecallSettings {
  Scalar stiffness_s2 = 1000;
  Scalar damping_ratio = 1;
  Scalar angular_stiffness_s2 = 1000;
  Scalar angular_damping_ratio = 1;
  Scalar weight_carried = 1;
  MaskSettings mask;
};

struct RuptureSettings {
  std::optional<Scalar> acceleration_m_s2;
  MaskSettings mask;
};

struct CellSettings {
  double density_kg_m3 = 1000;
  double shrink_m = 0.0003;
  Surface surface;
};

struct ReleaseByHeight {
  bool from_top = true;
  double start_s = 0;
  double end_s = 1;
  double share = 1;
};

struct ReleaseByDepth {
  bool from_outside = true;
  double start_s = 0;
  Scalar speed_m_s = 0.05;
};

struct ReleaseByHeat {
  double start_s = 0;
  MaskSettings source;
  bool held = false;
  bool geometric = false;
  Scalar rate_s = 20;
  double threshold = 0.02;
};

struct ReleaseRule {
  bool vanish = false;
  double vanish_s = 0.2;
  MaskSettings mask;
  std::variant<ReleaseByHeight, ReleaseByDepth, ReleaseByHeat> by;
};

/// What boxes, spheres and meshes have in common.
struct Placement {
  enum class Motion : std::uint8_t { kLoose, kFixed, kDriven };
  std::string name;
  Vector position_m = geometry::Vec3(geometry::Vec3::Zero());
  Vector rotation_deg = geometry::Vec3(geometry::Vec3::Zero());
  bool origin_is_take = true;
  Motion motion = Motion::kLoose;
  double mass_kg = 50;
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();
  double start_s = 0;
  Surface surface;
};

struct BoxSettings {
  Placement placement;
  geometry::Vec3 size_m = geometry::Vec3::Constant(0.3);
};

struct SphereSettings {
  Placement placement;
  double radius_m = 0.15;
};

struct MeshSettings {
  Placement placement;
  double scale = 1;
  geometry::TriangleMesh mesh;  // before scaling
};

struct PendulumSettings {
  std::string name;
  double radius_m = 0.12;
  double arm_m = 2.5;
  std::optional<geometry::Vec3> pivot_m;
  bool origin_is_take = true;
  std::optional<double> heading_deg;
  double start_angle_deg = 60;
  double hit_time_s = 1;
  double hit_height = 0.7;
  bool driven = true;
  double mass_kg = 50;
  Surface surface;
};

using ObjectSettings = std::variant<BoxSettings, SphereSettings, MeshSettings, PendulumSettings>;

struct Effect {
  std::string name;
  std::string description;
  std::optional<double> duration_s;
  double duration_min_s = 0;
  std::optional<double> output_fps;
  double rate_hz = 240;
  Scalar gravity_m_s2 = 9.81;
  GroundSettings ground;
  RecallSettings recall;
  RuptureSettings rupture;
  std::vector<ReleaseRule> release;
  std::vector<FieldSettings> fields;
  std::vector<DistortionSettings> distortion;
  BondSettings bonds;
  std::vector<PersistenceSettings> persistence;
  std::optional<MorphSettings> morph;
  CellSettings cells;
  std::vector<ObjectSettings> objects;
};

/// The typed form of canonical JSON (what NormaliseEffect returns). INVALID_ARGUMENT for what no single field shows to be wrong: a
/// release that ends before it starts, two objects of one name, a mesh whose triangles name corners that are not there.
/// Every field of the schema is read here and nothing else: that both know the same fields is checked.
absl::StatusOr<Effect> EffectFromCanonicalJson(const nlohmann::json& effect);

}  // namespace vorocast::simulation
