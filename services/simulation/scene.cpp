// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/scene.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "services/simulation/meshes.h"

namespace vorocast::simulation {
namespace {

using geometry::Cells;
using geometry::Quat;
using geometry::Rigid3;
using geometry::Vec3;

constexpr double kArmRadius = 0.012;  // metres, as drawn

double Radians(double degrees) { return degrees * std::numbers::pi / 180; }
Quat TurnAbout(const Vec3& axis, double radians) { return Quat(Eigen::AngleAxisd(radians, axis)); }

/// For each cell, its corners relative to the centroid: called with every corner.
template <typename Visit>
void VisitCorners(const Cells& cells, std::size_t c, const Visit& visit) {
  const auto first = static_cast<std::size_t>(cells.vertex_offset[static_cast<std::size_t>(cells.face_offset[c])]);
  const auto last = static_cast<std::size_t>(cells.vertex_offset[static_cast<std::size_t>(cells.face_offset[c + 1])]);
  for (std::size_t i = first; i < last; ++i) visit(Vec3(cells.vertices[static_cast<std::size_t>(cells.vertex[i])] - cells.centroid[c]));
}

/// The point of the performer that an "auto" pendulum goes through, and the horizontal direction in which the body is thinnest there.
struct Aim {
  Vec3 target;
  double heading;  // radians about y, 0 along +x, π/2 along +z
};
Aim AimAtBody(const Cells& cells, const std::vector<Rigid3>& pose, double hit_height) {
  double bottom = std::numeric_limits<double>::max();
  double top = std::numeric_limits<double>::lowest();
  for (const Rigid3& cell : pose) {
    bottom = std::min(bottom, cell.translation.y());
    top = std::max(top, cell.translation.y());
  }
  const double height = bottom + hit_height * (top - bottom);
  double nearest = std::numeric_limits<double>::max();
  for (const Rigid3& cell : pose) nearest = std::min(nearest, std::abs(cell.translation.y() - height));
  const double band = std::max(0.05 * (top - bottom), nearest);

  double weight = 0;
  Vec3 middle = Vec3::Zero();
  const auto for_band = [&](const auto& add) {
    for (std::size_t c = 0; c < pose.size(); ++c) {
      if (std::abs(pose[c].translation.y() - height) <= band) add(pose[c].translation, std::max(cells.volume[c], 1e-12));
    }
  };
  for_band([&](const Vec3& x, double volume) {
    weight += volume;
    middle += volume * x;
  });
  middle /= weight;
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for_band([&](const Vec3& x, double volume) {
    const Eigen::Vector2d d(x.x() - middle.x(), x.z() - middle.z());
    spread += volume * d * d.transpose();
  });
  const Eigen::Vector2d thinnest = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(spread).eigenvectors().col(0);
  const double sign = thinnest.x() < 0 || (thinnest.x() == 0 && thinnest.y() < 0) ? -1 : 1;
  return {Vec3(middle.x(), height, middle.z()), std::atan2(sign * thinnest.y(), sign * thinnest.x())};
}

/// The point on the ground under the middle of the first frame.
Vec3 TakeOrigin(const std::vector<Rigid3>& first_pose, double ground) {
  geometry::Box3 box;
  for (const Rigid3& cell : first_pose) box.extend(cell.translation);
  return {box.center().x(), ground, box.center().z()};
}

/// About x, then y, then z.
Quat Turned(const Vec3& degrees) {
  return TurnAbout(Vec3::UnitZ(), Radians(degrees.z())) * TurnAbout(Vec3::UnitY(), Radians(degrees.y())) *
         TurnAbout(Vec3::UnitX(), Radians(degrees.x()));
}

SceneBody Place(const Placement& placement, const Vec3& take_origin) {
  using Motion = Placement::Motion;
  SceneBody body;
  body.name = placement.name;
  body.motion = placement.motion == Motion::kFixed   ? SceneBody::Motion::kFixed
                : placement.motion == Motion::kLoose ? SceneBody::Motion::kLoose
                                                     : SceneBody::Motion::kDriven;
  body.mass = placement.mass_kg;
  body.surface = placement.surface;
  std::vector<Vector::Key> keys = placement.position_m.keys();
  for (Vector::Key& key : keys) key.value += placement.origin_is_take ? take_origin : Vec3(Vec3::Zero());
  body.start.position = keys.front().value;
  body.start.rotation = Turned(placement.rotation_deg.keys().front().value);
  body.start.velocity = placement.velocity_m_s;
  body.start_s = placement.start_s;
  if (placement.motion == Motion::kDriven) body.path = SceneBody::Path{.position = Vector(std::move(keys)), .rotation_deg = placement.rotation_deg};
  return body;
}

/// Works out the place of one object after another.
class Placer {
 public:
  Placer(const Effect& effect, const Cells& cells, const TrackedMotion& motion, const Vec3& origin)
      : effect_(effect), cells_(cells), motion_(motion), origin_(origin) {}

  absl::StatusOr<SceneBody> operator()(const BoxSettings& box) const {
    SceneBody body = Place(box.placement, origin_);
    body.box_half = 0.5 * box.size_m;
    body.mesh = BoxMesh(*body.box_half);
    return body;
  }

  absl::StatusOr<SceneBody> operator()(const SphereSettings& sphere) const {
    SceneBody body = Place(sphere.placement, origin_);
    body.radius = sphere.radius_m;
    body.mesh = SphereMesh(sphere.radius_m);
    return body;
  }

  absl::StatusOr<SceneBody> operator()(const MeshSettings& mesh) const {
    SceneBody body = Place(mesh.placement, origin_);
    body.is_mesh = true;
    body.mesh = mesh.mesh;
    for (Vec3& vertex : body.mesh.vertices) vertex *= mesh.scale;
    return body;
  }

  absl::StatusOr<SceneBody> operator()(const PendulumSettings& pendulum) const {
    const double gravity = effect_.gravity_m_s2.At(pendulum.hit_time_s);
    if (!(gravity > 0)) {
      return absl::InvalidArgumentError(
          fmt::format("effect: gravity_m_s2: the pendulum \"{}\" swings only with gravity above 0, not {}", pendulum.name, gravity));
    }
    std::vector<Rigid3> pose;
    motion_.Sample(pendulum.hit_time_s, pose);
    const Aim aim = AimAtBody(cells_, pose, pendulum.hit_height);
    const Vec3 given = pendulum.pivot_m.value_or(Vec3::Zero()) + (pendulum.origin_is_take ? origin_ : Vec3(Vec3::Zero()));
    const Vec3 pivot = pendulum.pivot_m ? given : Vec3(aim.target + pendulum.arm_m * Vec3::UnitY());
    const double heading = pendulum.heading_deg ? Radians(*pendulum.heading_deg) : aim.heading;

    SceneBody body;
    body.name = pendulum.name;
    body.motion = pendulum.driven ? SceneBody::Motion::kDriven : SceneBody::Motion::kLoose;
    body.radius = pendulum.radius_m;
    body.mass = pendulum.mass_kg;
    body.surface = pendulum.surface;
    body.body_from_object = {Quat::Identity(), pendulum.arm_m * Vec3::UnitY()};
    const auto arm = ArmMesh(std::min(kArmRadius, 0.5 * pendulum.radius_m), std::max(pendulum.arm_m - pendulum.radius_m, 0.01));
    body.mesh = Join(arm, SphereMesh(pendulum.radius_m), -pendulum.arm_m * Vec3::UnitY());
    const PendulumSwing swing(Radians(pendulum.start_angle_deg), gravity, EquivalentLength(pendulum.arm_m, pendulum.radius_m), pendulum.hit_time_s);
    // Heading 90° is +z, so it turns the x axis about −y.
    body.hinge = SceneBody::Hinge{.world_from_pivot = {TurnAbout(Vec3::UnitY(), -heading), pivot}, .arm = pendulum.arm_m, .swing = swing};
    body.start_s = std::max(swing.start_time(), 0.0);
    body.start = body.StateWhenLoose(body.start_s);
    return body;
  }

 private:
  const Effect& effect_;
  const Cells& cells_;
  const TrackedMotion& motion_;
  const Vec3 origin_;
};

}  // namespace

Rigid3 SceneBody::DrivenPose(double time) const {
  if (path) return {Turned(path->rotation_deg.At(time)), path->position.At(time)};
  const Rigid3 pivot_from_object{TurnAbout(Vec3::UnitZ(), hinge->swing.Angle(time)), Vec3::Zero()};
  return hinge->world_from_pivot * pivot_from_object * body_from_object.Inverse();
}

BodyState SceneBody::StateWhenLoose(double time) const {
  if (!hinge) return start;
  const Rigid3 pose = DrivenPose(time);
  const Vec3 turning = hinge->swing.AngularVelocity(time) * (pose.rotation * Vec3::UnitZ());
  return {.position = pose.translation,
          .rotation = pose.rotation,
          .velocity = turning.cross(pose.translation - hinge->world_from_pivot.translation),
          .angular_velocity = turning};
}

double LowestPoint(const Cells& cells, const TrackedMotion& motion) {
  std::vector<double> radius(cells.size(), 0);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    VisitCorners(cells, c, [&](const Vec3& corner) { radius[c] = std::max(radius[c], corner.norm()); });
  }
  double lowest = std::numeric_limits<double>::max();
  for (std::size_t f = 0; f < motion.frame_count(); ++f) {
    const Rigid3* pose = motion.AtFrame(f);
    for (std::size_t c = 0; c < cells.size(); ++c) {
      if (pose[c].translation.y() - radius[c] >= lowest) continue;
      lowest = std::min(lowest, pose[c].translation.y());
      VisitCorners(cells, c, [&](const Vec3& corner) { lowest = std::min(lowest, (pose[c] * corner).y()); });
    }
  }
  return lowest;
}

absl::StatusOr<Scene> MakeScene(const Effect& effect, const Cells& cells, const TrackedMotion& motion) {
  const double ground = effect.ground.height_m ? *effect.ground.height_m : LowestPoint(cells, motion);
  Scene scene;
  if (effect.ground.enabled) scene.ground_height = ground;
  std::vector<Rigid3> first_pose(motion.AtFrame(0), motion.AtFrame(0) + motion.cell_count());
  scene.take_origin = TakeOrigin(first_pose, ground);
  const Placer placer(effect, cells, motion, scene.take_origin);
  for (const ObjectSettings& object : effect.objects) {
    ASSIGN_OR_RETURN(SceneBody body, std::visit(placer, object));
    scene.bodies.push_back(std::move(body));
  }
  return scene;
}

}  // namespace vorocast::simulation
