// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/tracking/frame_fit.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vorocast::tracking {
namespace {

using geometry::Vec3;
using geometry::Vec3f;

// Distances along the surface count this much of those across it: samples are a centimetre apart, and their spacing says nothing about the fit.
constexpr float kAlongSurface = 0.15F;
// A point this many σ from its best partner is as likely an outlier as not.
constexpr double kOutlierSigmas = 2.5;
// Inner points hold the volume together, but cells of two frames never correspond: much more weight and they hold it back.
constexpr double kInnerWeight = 0.03;
constexpr double kInnerReach = 1.2;  // cell spacings
// Mass of the regulariser for each surface point, whatever the number of points, cells and patches; 0.3 of it is best on captures with known motion.
constexpr double kRegulariserBalance = 0.2;
constexpr double kDamping = 1e-4;

/// The weights α of up to 3 partners: soft assignment over the candidates and an outlier class (paper, section 4.3).
std::array<double, 3> SoftWeights(const std::array<double, 3>& squared_distance, int count, double sigma) {
  std::array<double, 3> alpha{};
  double total = std::exp(-0.5 * kOutlierSigmas * kOutlierSigmas);
  for (int i = 0; i < count; ++i) total += alpha[i] = std::exp(-0.5 * squared_distance[i] / (sigma * sigma));
  for (double& a : alpha) a /= total;
  return alpha;
}

}  // namespace

FrameFit::FrameFit(const PatchModel& model)
    : model_(model),
      equations_(model),
      centre_(static_cast<std::size_t>(model.patch_count)),
      surface_data_(static_cast<std::size_t>(model.patch_count)),
      inner_data_(static_cast<std::size_t>(model.patch_count)) {}

void FrameFit::Partners::Offer(float score, const PosedPoint& point) {
  int worst = 0;
  for (int i = 0; i < count; ++i) {
    if (best[i].point->patch == point.patch) {
      if (score < best[i].score) best[i] = {score, &point};
      return;
    }
    if (best[i].score > best[worst].score) worst = i;
  }
  if (count < 3) {
    best[count++] = {score, &point};
  } else if (score < best[worst].score) {
    best[worst] = {score, &point};
  }
}

void FrameFit::PoseSurface(const Pose& pose, const FitStage& stage) {
  origin_ = pose[0] * model_.centre[0];
  std::vector<Eigen::Matrix3f> rotation;
  std::vector<Vec3> offset;
  for (std::int32_t k = 0; k < model_.patch_count; ++k) {
    rotation.push_back(pose[k].rotation.toRotationMatrix().cast<float>());
    centre_[k] = (pose[k] * model_.centre[k] - origin_).cast<float>();
  }
  posed_.clear();
  for (const SurfaceSample& sample : stage.coarse ? model_.surface_coarse : model_.surface) {
    const Vec3f arm = (sample.position - model_.centre[sample.patch]).cast<float>();
    posed_.push_back({centre_[sample.patch] + rotation[sample.patch] * arm, rotation[sample.patch] * sample.normal.cast<float>(), 0, sample.patch});
  }
  surface_.Build(posed_, static_cast<float>(stage.reach_m));
}

void FrameFit::PoseInner(const Pose& pose, double cell_m) {
  posed_.clear();
  for (const InnerSample& sample : model_.inner) {
    posed_.push_back({(pose[sample.patch] * sample.position - origin_).cast<float>(), Vec3f::Zero(), static_cast<float>(sample.depth), sample.patch});
  }
  inner_.Build(posed_, static_cast<float>(cell_m));
}

FrameFit::Partners FrameFit::SurfacePartners(const Vec3f& x, const Vec3f& normal, const FitStage& stage) const {
  Partners partners;
  const auto reach_squared = static_cast<float>(stage.reach_m * stage.reach_m);
  const auto cosine_min = static_cast<float>(stage.cosine_min);
  surface_.VisitNear(x, [&](const PosedPoint& point) {
    const Vec3f delta = point.position - x;
    const float squared = delta.squaredNorm();
    if (squared > reach_squared || normal.dot(point.normal) < cosine_min) return;
    const float across = delta.dot(point.normal);
    partners.Offer(kAlongSurface * squared + (1 - kAlongSurface) * across * across, point);
  });
  return partners;
}

void FrameFit::AssociateSurface(const ObservedFrame& frame, const FitStage& stage) {
  for (std::size_t i = stage.phase; i < frame.position.size(); i += stage.stride) {
    const Vec3f x = (frame.position[i] - origin_).cast<float>();
    const Vec3f normal = frame.normal[i].cast<float>();
    const Partners partners = SurfacePartners(x, normal, stage);
    if (partners.count == 0) continue;
    std::array<double, 3> squared{};
    for (int c = 0; c < partners.count; ++c) squared[c] = partners.best[c].score;
    const auto alpha = SoftWeights(squared, partners.count, stage.sigma_m);
    for (int c = 0; c < partners.count; ++c) {
      if (alpha[c] < 1e-3) continue;
      const PosedPoint& point = *partners.best[c].point;
      const Vec3 arm = (point.position - centre_[point.patch]).cast<double>();
      const Vec3 delta = (point.position - x).cast<double>();
      // The normal halfway between both is exact on spheres and cylinders, where either tangent plane alone is off by offset² / 2 radius.
      const Vec3 between = (normal + point.normal).cast<double>().normalized();
      surface_data_[point.patch].AddPointToPlane(arm, between, delta, alpha[c]);
    }
  }
}

void FrameFit::AssociateInner(const ObservedFrame& frame, const FitStage& stage) {
  const double reach = kInnerReach * model_.cell_spacing_m;
  const double sigma = std::max(stage.sigma_m, 0.5 * model_.cell_spacing_m);
  for (std::size_t i = stage.phase % stage.inner_stride; i < frame.inner.size(); i += stage.inner_stride) {
    const Vec3f x = (frame.inner[i] - origin_).cast<float>();
    const auto depth = static_cast<float>(frame.inner_depth[i]);
    Partners partners;
    inner_.VisitNear(x, [&](const PosedPoint& point) {
      const float squared = (point.position - x).squaredNorm();
      if (squared > reach * reach || std::abs(point.depth - depth) > stage.depth_tolerance_m) return;
      partners.Offer(squared, point);
    });
    std::array<double, 3> squared{};
    for (int c = 0; c < partners.count; ++c) squared[c] = partners.best[c].score;
    const auto alpha = SoftWeights(squared, partners.count, sigma);
    for (int c = 0; c < partners.count; ++c) {
      const PosedPoint& point = *partners.best[c].point;
      inner_data_[point.patch].AddPointToPoint((point.position - centre_[point.patch]).cast<double>(), (point.position - x).cast<double>(), alpha[c]);
    }
  }
}

void FrameFit::Step(const ObservedFrame& frame, const FitStage& stage, const std::vector<Relation>& reference, Pose& pose) {
  for (DataBlock& block : surface_data_) block.Clear();
  for (DataBlock& block : inner_data_) block.Clear();
  PoseSurface(pose, stage);
  AssociateSurface(frame, stage);
  if (!frame.inner.empty()) {
    PoseInner(pose, kInnerReach * model_.cell_spacing_m);
    AssociateInner(frame, stage);
  }

  equations_.Clear();
  for (std::int32_t k = 0; k < model_.patch_count; ++k) {
    surface_data_[k].AddTo(equations_.Diagonal(k), equations_.Gradient(k), static_cast<double>(stage.stride));
    inner_data_[k].AddTo(equations_.Diagonal(k), equations_.Gradient(k), kInnerWeight * static_cast<double>(stage.inner_stride));
  }
  const double points = std::max<double>(static_cast<double>(frame.position.size()), 1);
  const double mass = std::max(model_.edge_mass, 1.0);
  AddPoseDistance(model_, pose, reference, stage.regulariser * kRegulariserBalance * points / mass, equations_);
  equations_.Solve(kDamping, twists_);
  ApplyTwists(model_, twists_, pose);
}

FitQuality FrameFit::Measure(const ObservedFrame& frame, const FitStage& stage, const Pose& pose) {
  PoseSurface(pose, stage);
  const double limit = 4 * stage.sigma_m * stage.sigma_m;
  std::size_t seen = 0;
  std::size_t found = 0;
  double plane_squared = 0;
  double capped = 0;
  for (std::size_t i = stage.phase; i < frame.position.size(); i += stage.stride) {
    ++seen;
    const Vec3f x = (frame.position[i] - origin_).cast<float>();
    const Vec3f normal = frame.normal[i].cast<float>();
    const Partners partners = SurfacePartners(x, normal, stage);
    const PosedPoint* nearest = nullptr;
    double score = limit;
    for (int c = 0; c < partners.count; ++c) {
      if (partners.best[c].score < score) score = partners.best[c].score, nearest = partners.best[c].point;
    }
    capped += score;
    if (nearest == nullptr) continue;
    ++found;
    const double across = (normal + nearest->normal).normalized().dot(nearest->position - x);
    plane_squared += across * across;
  }
  return QualityOf(seen, found, capped, plane_squared);
}

FitQuality QualityOf(std::size_t seen, std::size_t found, double capped, double plane_squared) {
  FitQuality quality;
  if (seen == 0) return quality;
  quality.confidence = static_cast<double>(found) / static_cast<double>(seen);
  quality.squared_mean = capped / static_cast<double>(seen);
  if (found > 0) quality.residual_m = std::sqrt(plane_squared / static_cast<double>(found));
  return quality;
}

}  // namespace vorocast::tracking
