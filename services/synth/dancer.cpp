// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/dancer.h"

#include <algorithm>
#include <cmath>

#include "services/synth/implicit_surface.h"
#include "services/synth/palette.h"
#include "services/synth/synth.h"

namespace vorocast::synth {
namespace {

using geometry::Quat;
using geometry::Vec3;

/// How far from a joint, in metres of distance to its bones, the skin follows both.
constexpr double kJointSoftness_m = 0.022;
constexpr int kWeightSmoothing = 6;

class Sculptor {
 public:
  explicit Sculptor(ImplicitSurface& surface) : surface_(surface) {}

  /// What follows is one limb; a negative number ends it.
  Sculptor& Limb(std::int32_t limb) {
    limb_ = limb;
    return *this;
  }
  Sculptor& On(std::int32_t bone, Part part) {
    bone_ = bone, part_ = part;
    return *this;
  }
  Sculptor& Swept(const Vec3& from, const Vec3& to, double from_radius, double to_radius, const Vec3& stretch = Vec3::Ones()) {
    surface_.Add({from, to, from_radius, to_radius, stretch, bone_, static_cast<std::int32_t>(part_), limb_});
    return *this;
  }
  /// An ellipsoid by its half axes.
  Sculptor& Round(const Vec3& centre, const Vec3& half_axes) {
    const double radius = half_axes.maxCoeff();
    return Swept(centre, centre, radius, radius, half_axes / radius);
  }

 private:
  ImplicitSurface& surface_;
  std::int32_t bone_ = 0;
  std::int32_t limb_ = -1;
  Part part_ = Part::kTorso;
};

void SculptHead(Sculptor& sculptor) {
  sculptor.On(kNeck, Part::kHead).Swept({0, 1.43, -0.022}, {0, 1.56, -0.010}, 0.054, 0.046);
  sculptor.On(kSkull, Part::kHead)
      .Round({0, 1.652, 0.012}, {0.074, 0.088, 0.086})
      .Swept({-0.022, 1.604, 0.026}, {0.022, 1.604, 0.026}, 0.047, 0.047)
      .Swept({0, 1.602, 0.045}, {0, 1.570, 0.066}, 0.040, 0.024)
      .Swept({0, 1.640, 0.094}, {0, 1.620, 0.104}, 0.008, 0.011);
  sculptor.On(kSkull, Part::kHair)
      .Round({0, 1.674, -0.012}, {0.086, 0.084, 0.094})
      .Round({0, 1.628, -0.036}, {0.080, 0.062, 0.070})
      .Round({0, 1.722, -0.100}, {0.050, 0.044, 0.047});
}

void SculptTorso(Sculptor& sculptor) {
  const Vec3 flat(1, 1, 0.72);
  sculptor.On(kPelvis, Part::kTorso).Swept({-0.072, 0.945, 0}, {0.072, 0.945, 0}, 0.103, 0.103, {1, 1, 0.98});
  sculptor.On(kWaist, Part::kTorso).Swept({0, 1.02, 0}, {0, 1.13, -0.004}, 0.128, 0.112, {1.04, 1, 0.80});
  sculptor.On(kChest, Part::kTorso)
      .Swept({0, 1.20, -0.008}, {0, 1.33, -0.018}, 0.121, 0.150, flat)
      .Swept({-0.085, 1.385, -0.024}, {0.085, 1.385, -0.024}, 0.062, 0.062, {1, 1, 0.95});
  for (const double side : {-1.0, 1.0}) {
    sculptor.On(kPelvis, Part::kTorso).Round({side * 0.064, 0.925, -0.058}, {0.076, 0.080, 0.068});
    sculptor.On(kChest, Part::kTorso).Round({side * 0.066, 1.285, 0.072}, {0.056, 0.056, 0.046});
    sculptor.On(side > 0 ? kLeftCollar : kRightCollar, Part::kTorso).Swept({side * 0.03, 1.435, -0.022}, {side * 0.14, 1.415, -0.02}, 0.042, 0.046);
  }
}

void SculptArm(Sculptor& sculptor, bool left) {
  const std::int32_t upper = left ? kLeftUpperArm : kRightUpperArm;
  const Part part = left ? Part::kLeftArm : Part::kRightArm;
  const PerBone<Vec3>& joints = RestJoints();
  const Vec3 along = RestArmDirection(left);
  const Vec3 forward = Vec3::UnitZ();
  const Vec3 down = left ? along.cross(forward).eval() : forward.cross(along).eval();
  const Vec3& shoulder = joints[static_cast<std::size_t>(upper)];
  const Vec3& elbow = joints[static_cast<std::size_t>(upper) + 1];
  const Vec3& wrist = joints[static_cast<std::size_t>(upper) + 2];
  sculptor.Limb(upper).On(upper, part).Swept(shoulder, elbow, 0.047, 0.036).Swept(shoulder + 0.03 * along, shoulder + 0.12 * along, 0.050, 0.040);
  sculptor.On(upper + 1, part).Swept(elbow, wrist, 0.036, 0.025).Swept(elbow + 0.03 * along, elbow + 0.12 * along, 0.039, 0.032);
  // A mitten: fingers are finer than the depth cameras resolve.
  sculptor.On(upper + 2, part)
      .Swept(wrist, wrist + 0.075 * along, 0.025, 0.036, {1, 1, 0.85})
      .Swept(wrist + 0.075 * along, wrist + 0.165 * along, 0.032, 0.016, {1, 1, 0.9})
      .Swept(wrist + 0.03 * along + 0.022 * forward, wrist + 0.09 * along + 0.052 * forward + 0.005 * down, 0.017, 0.011);
}

void SculptLeg(Sculptor& sculptor, bool left) {
  const std::int32_t thigh = left ? kLeftThigh : kRightThigh;
  const Part part = left ? Part::kLeftLeg : Part::kRightLeg;
  const PerBone<Vec3>& joints = RestJoints();
  const Vec3 along = RestLegDirection(left);
  const Vec3& hip = joints[static_cast<std::size_t>(thigh)];
  const Vec3& knee = joints[static_cast<std::size_t>(thigh) + 1];
  const Vec3& ankle = joints[static_cast<std::size_t>(thigh) + 2];
  sculptor.Limb(thigh).On(thigh, part).Swept(hip, knee, 0.084, 0.051).Swept(hip + 0.06 * along, hip + 0.22 * along, 0.084, 0.072);
  sculptor.On(thigh + 1, part).Swept(knee, ankle, 0.050, 0.033).Swept(knee + Vec3(0, -0.07, -0.018), knee + Vec3(0, -0.17, -0.016), 0.046, 0.041);
  const Vec3 sole(ankle.x(), 0, ankle.z());
  const double toe_out = left ? 0.02 : -0.02;
  sculptor.Limb(thigh + 2)
      .On(thigh + 2, Part::kShoes)
      .Swept(ankle, sole + Vec3(0, 0.035, -0.032), 0.036, 0.037)
      .Swept(sole + Vec3(0, 0.045, 0.0), sole + Vec3(toe_out * 0.7, 0.026, 0.125), 0.038, 0.038, {1.0, 0.8, 1})
      .Swept(sole + Vec3(toe_out * 0.7, 0.026, 0.125), sole + Vec3(toe_out, 0.018, 0.168), 0.036, 0.025, {1.0, 0.75, 1});
}

ImplicitSurface SculptDancer() {
  ImplicitSurface surface(0.034, 0.012, 0.0);
  Sculptor sculptor(surface);
  SculptHead(sculptor);
  SculptTorso(sculptor);
  for (const bool left : {true, false}) {
    SculptArm(sculptor, left);
    SculptLeg(sculptor, left);
  }
  return surface;
}

/// Weight of every bone on one vertex: falls off with the distance to the bone's own blobs, and only bones near the nearest one count.
PerBone<double> WeightsAt(const ImplicitSurface& surface, const Vec3& x) {
  PerBone<double> distance;
  distance.fill(1e9);
  for (const Blob& blob : surface.blobs()) {
    double& d = distance[static_cast<std::size_t>(blob.bone)];
    d = std::min(d, blob.Distance(x));
  }
  const auto nearest = static_cast<std::int32_t>(std::ranges::min_element(distance) - distance.begin());
  PerBone<double> weight{};
  double sum = 0;
  for (std::int32_t bone = 0; bone < kBones; ++bone) {
    if (!AreNear(nearest, bone)) continue;
    const auto b = static_cast<std::size_t>(bone);
    weight[b] = std::exp(-(distance[b] - distance[static_cast<std::size_t>(nearest)]) / kJointSoftness_m);
    sum += weight[b];
  }
  for (double& w : weight) w /= sum;
  return weight;
}

/// A few rounds of averaging over neighbouring vertices take the creases out where the nearest bone changes.
void SmoothWeights(const geometry::TriangleMesh& mesh, std::vector<PerBone<double>>& weights) {
  for (int round = 0; round < kWeightSmoothing; ++round) {
    std::vector<PerBone<double>> sum = weights;
    std::vector<double> count(weights.size(), 1);
    for (const auto& t : mesh.triangles) {
      for (std::size_t c = 0; c < 3; ++c) {
        const auto from = static_cast<std::size_t>(t[(c + 1) % 3]);
        const auto to = static_cast<std::size_t>(t[c]);
        for (std::size_t b = 0; b < sum[to].size(); ++b) sum[to][b] += weights[from][b];
        count[to] += 1;
      }
    }
    for (std::size_t v = 0; v < weights.size(); ++v) {
      for (std::size_t b = 0; b < weights[v].size(); ++b) weights[v][b] = sum[v][b] / count[v];
    }
  }
}

SkinWeights FourLargest(const PerBone<double>& weights) {
  PerBone<std::int32_t> order;
  for (std::size_t b = 0; b < order.size(); ++b) order[b] = static_cast<std::int32_t>(b);
  std::ranges::stable_sort(
      order, [&](std::int32_t a, std::int32_t b) { return weights[static_cast<std::size_t>(a)] > weights[static_cast<std::size_t>(b)]; });
  SkinWeights skin;
  double sum = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    skin.bone[i] = order[i];
    skin.weight[i] = weights[static_cast<std::size_t>(order[i])];
    sum += skin.weight[i];
  }
  for (double& w : skin.weight) w /= sum;
  return skin;
}

std::int32_t NearestPart(const ImplicitSurface& surface, const Vec3& x) {
  const auto nearest = std::ranges::min_element(surface.blobs(), {}, [&](const Blob& blob) { return blob.Distance(x); });
  return nearest->part;
}

}  // namespace

SkinnedBody MakeDancer(double cell_m) {
  const ImplicitSurface surface = SculptDancer();
  SkinnedBody body;
  body.rest = ExtractSurface(surface, cell_m);
  std::vector<PerBone<double>> weights;
  weights.reserve(body.rest.vertices.size());
  for (const Vec3& x : body.rest.vertices) weights.push_back(WeightsAt(surface, x));
  SmoothWeights(body.rest, weights);
  for (std::size_t v = 0; v < weights.size(); ++v) {
    body.weights.push_back(FourLargest(weights[v]));
    body.part.push_back(NearestPart(surface, body.rest.vertices[v]));
    body.rest.colours.push_back(ColourOf(static_cast<Part>(body.part[v]), body.rest.vertices[v]));
  }
  return body;
}

std::vector<Vec3> PoseSkin(const SkinnedBody& body, const Pose& pose) {
  // A dual quaternion holds a rigid transform: real part the rotation q, dual part (0, t) q / 2.
  struct DualQuat {
    Eigen::Vector4d real, dual;
  };
  PerBone<DualQuat> motion;
  for (std::size_t b = 0; b < motion.size(); ++b) {
    const Quat& q = pose[b].rotation;
    const Vec3& t = pose[b].translation;
    motion[b] = {q.coeffs(), 0.5 * (Quat(0, t.x(), t.y(), t.z()) * q).coeffs()};
  }
  std::vector<Vec3> posed(body.rest.vertices.size());
  for (std::size_t v = 0; v < posed.size(); ++v) {
    const SkinWeights& skin = body.weights[v];
    const Eigen::Vector4d& pivot = motion[static_cast<std::size_t>(skin.bone[0])].real;
    Eigen::Vector4d real = Eigen::Vector4d::Zero(), dual = Eigen::Vector4d::Zero();
    for (std::size_t i = 0; i < 4; ++i) {
      const DualQuat& m = motion[static_cast<std::size_t>(skin.bone[i])];
      const double w = m.real.dot(pivot) < 0 ? -skin.weight[i] : skin.weight[i];
      real += w * m.real;
      dual += w * m.dual;
    }
    const double length = real.norm();
    const Quat rotation(real / length);
    const Vec3 translation = 2 * (Quat(dual / length) * rotation.conjugate()).vec();
    posed[v] = rotation * body.rest.vertices[v] + translation;
  }
  return posed;
}

}  // namespace vorocast::synth
