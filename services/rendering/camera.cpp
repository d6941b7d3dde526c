// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/camera.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <tuple>
#include <utility>

namespace vorocast::rendering {
namespace {

using geometry::Vec3f;

constexpr double kTrimmed = 0.001;
constexpr float kMargin = 0.07F;         // of the window's larger side, on every side
constexpr float kEyeDistance = 3.2F;     // in units of the extent: a long lens, as for portraits
constexpr float kCompanionReach = 0.5F;  // in units of the extent, beyond the subject's box
constexpr float kDebrisReach = 0.3F;     // likewise: a floor full of fallen cells must not make the performer small
constexpr double kHeightMin = 0.5;       // in units of the width
constexpr double kHeightMax = 1.6;
constexpr float kToesAgree = 0.8F;
constexpr double kThreeQuartersDegrees = 25;
constexpr double kAzimuthStepDegrees = 15;  // so that the stages of one take are seen from the same side, though they differ a little

/// The values' range without the trimmed part of each end.
std::pair<float, float> TrimmedRange(std::vector<float> values) {
  const auto trimmed = static_cast<std::ptrdiff_t>(kTrimmed * static_cast<double>(values.size()));
  std::ranges::nth_element(values, values.begin() + trimmed);
  const float low = values[static_cast<std::size_t>(trimmed)];
  std::ranges::nth_element(values, values.end() - 1 - trimmed);
  return {low, *(values.end() - 1 - trimmed)};
}

/// Mean of the centres between two heights; false where there are none.
bool MeanBetween(const Bounds& bounds, float low, float high, Vec3f& mean) {
  Vec3f sum = Vec3f::Zero();
  std::size_t count = 0;
  for (const Vec3f& c : bounds.centres) {
    if (c.y() < low || c.y() > high) continue;
    sum += c;
    ++count;
  }
  if (count == 0) return false;
  mean = sum / static_cast<float>(count);
  return true;
}

}  // namespace

double ChooseAzimuth(const std::vector<Bounds>& pictures) {
  // Horizontal second moments about each picture's own middle, so that walking about does not count, and the direction of the feet.
  double xx = 0, xz = 0, zz = 0;
  Vec3f toes = Vec3f::Zero();
  float toes_length = 0;
  for (const Bounds& bounds : pictures) {
    if (bounds.centres.empty()) continue;
    Vec3f middle = Vec3f::Zero();
    float low = bounds.centres[0].y();
    float high = low;
    for (const Vec3f& c : bounds.centres) {
      middle += c / static_cast<float>(bounds.centres.size());
      low = std::min(low, c.y());
      high = std::max(high, c.y());
    }
    for (const Vec3f& c : bounds.centres) {
      const Eigen::Vector3d arm = (c - middle).cast<double>() / std::sqrt(static_cast<double>(bounds.centres.size()));
      xx += arm.x() * arm.x();
      xz += arm.x() * arm.z();
      zz += arm.z() * arm.z();
    }
    const float height = high - low;
    Vec3f feet;
    Vec3f shins;
    if (!MeanBetween(bounds, low, low + 0.04F * height, feet) || !MeanBetween(bounds, low + 0.12F * height, low + 0.25F * height, shins)) continue;
    const Vec3f step = Vec3f(1, 0, 1).cwiseProduct(feet - shins);
    toes += step;
    toes_length += step.norm();
  }
  const double widest = 0.5 * std::atan2(2 * xz, xx - zz);  // angle from x towards z
  Vec3f front(static_cast<float>(-std::sin(widest)), 0, static_cast<float>(std::cos(widest)));
  if (front.dot(toes) < 0 || (front.dot(toes) == 0 && front.z() < 0)) front = -front;
  // Feet that agree with each other know better than the widest direction, which is none for a body with its arms down.
  if (toes.norm() > kToesAgree * toes_length && toes.norm() > 0) front = toes;
  const double azimuth = std::atan2(static_cast<double>(front.x()), static_cast<double>(front.z())) * 180 / std::numbers::pi + kThreeQuartersDegrees;
  return kAzimuthStepDegrees * std::round(azimuth / kAzimuthStepDegrees);
}

absl::Status Settle(Bounds& bounds) {
  if (bounds.centres.empty()) {
    std::swap(bounds.centres, bounds.debris);
    std::swap(bounds.radii, bounds.debris_radii);
  }
  if (bounds.centres.empty()) return absl::InvalidArgumentError("there is nothing to draw: every picture is empty");
  Vec3f low;
  Vec3f high;
  std::vector<float> values(bounds.centres.size());
  for (const auto* spheres : {&bounds.centres, &bounds.debris}) {
    for (const Vec3f& c : *spheres) {
      if (!c.allFinite()) return absl::InvalidArgumentError("a position is not finite");
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    std::ranges::transform(bounds.centres, values.begin(), [axis](const Vec3f& c) { return c[axis]; });
    std::tie(low[axis], high[axis]) = TrimmedRange(values);
  }
  const float slack = 0.01F * (high - low).maxCoeff();  // nearly all of the trimmed ones are no strays
  Bounds kept;
  kept.ground = high.y();
  for (std::size_t i = 0; i < bounds.centres.size(); ++i) {
    const Vec3f& c = bounds.centres[i];
    if (((c - low).array() < -slack).any() || ((c - high).array() > slack).any()) continue;
    kept.centres.push_back(c);
    kept.radii.push_back(bounds.radii[i]);
    kept.ground = std::min(kept.ground, c.y() - bounds.radii[i]);
  }
  kept.extent = std::max((high - low).maxCoeff(), 2 * *std::ranges::max_element(kept.radii));
  const auto near = [&](const Vec3f& c, float reach) {
    return ((c - low).array() >= -reach * kept.extent).all() && ((c - high).array() <= reach * kept.extent).all();
  };
  std::ranges::copy_if(bounds.companions, std::back_inserter(kept.companions), [&](const Vec3f& c) { return near(c, kCompanionReach); });
  for (std::size_t i = 0; i < bounds.debris.size(); ++i) {
    if (!near(bounds.debris[i], kDebrisReach)) continue;
    kept.debris.push_back(bounds.debris[i]);
    kept.debris_radii.push_back(bounds.debris_radii[i]);
    kept.ground = std::min(kept.ground, bounds.debris[i].y() - bounds.debris_radii[i]);
  }
  bounds = std::move(kept);
  return absl::OkStatus();
}

Camera FrameBounds(const Bounds& bounds, const Framing& framing) {
  const auto azimuth = static_cast<float>(framing.azimuth_deg * std::numbers::pi / 180);
  const auto elevation = static_cast<float>(framing.elevation_deg * std::numbers::pi / 180);
  Vec3f low = bounds.centres[0];
  Vec3f high = low;
  for (const Vec3f& c : bounds.centres) {
    low = low.cwiseMin(c);
    high = high.cwiseMax(c);
  }
  Camera camera;
  const Vec3f back(std::sin(azimuth) * std::cos(elevation), std::sin(elevation), std::cos(azimuth) * std::cos(elevation));
  camera.forward = -back;
  camera.right = Vec3f::UnitY().cross(back).normalized();
  camera.up = back.cross(camera.right);
  camera.eye = (low + high) / 2 + kEyeDistance * std::max(bounds.extent, 1e-3F) * back;

  // The window: extents of all spheres on the plane at distance 1. A sphere's own size there is radius / depth, near enough this far off.
  float left = 1e9F, right = -1e9F, bottom = 1e9F, top = -1e9F;
  const auto show = [&](const Vec3f& centre, float radius) {
    const Vec3f arm = centre - camera.eye;
    const float depth = std::max(arm.dot(camera.forward), 1e-3F);
    const float x = arm.dot(camera.right) / depth;
    const float y = arm.dot(camera.up) / depth;
    const float r = radius / depth;
    left = std::min(left, x - r), right = std::max(right, x + r);
    bottom = std::min(bottom, y - r), top = std::max(top, y + r);
  };
  for (std::size_t i = 0; i < bounds.centres.size(); ++i) show(bounds.centres[i], bounds.radii[i]);
  for (const Vec3f& corner : bounds.companions) show(corner, 0);
  for (std::size_t i = 0; i < bounds.debris.size(); ++i) show(bounds.debris[i], bounds.debris_radii[i]);
  const float margin = kMargin * std::max(right - left, top - bottom);
  left -= margin, right += margin, bottom -= margin, top += margin;
  // Too flat or too tall a window grows on both sides.
  const double ratio = static_cast<double>((top - bottom) / (right - left));
  if (ratio < kHeightMin) {
    const float missing = static_cast<float>(kHeightMin) * (right - left) - (top - bottom);
    top += missing * 0.7F, bottom -= missing * 0.3F;
  } else if (ratio > kHeightMax) {
    const float missing = (top - bottom) / static_cast<float>(kHeightMax) - (right - left);
    left -= missing / 2, right += missing / 2;
  }
  camera.width = framing.width;
  camera.height = static_cast<std::int32_t>(std::lround(static_cast<double>(framing.width * (top - bottom) / (right - left))));
  camera.left = left;
  camera.top = top;
  camera.pixel = (right - left) / static_cast<float>(framing.width);
  return camera;
}

}  // namespace vorocast::rendering
