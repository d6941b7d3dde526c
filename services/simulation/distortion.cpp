// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/distortion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "services/simulation/recall.h"

namespace vorocast::simulation {
namespace {

using geometry::Quat;
using geometry::Rigid3;
using geometry::Vec3;

Vec3 Middle(const std::vector<Rigid3>& poses) {
  Vec3 sum = Vec3::Zero();
  for (const Rigid3& pose : poses) sum += pose.translation;
  return sum / static_cast<double>(poses.size());
}

/// What one setting does at one time to a cell of a given weight.
class Twist {
 public:
  Twist(const TwistSettings& twist, double time, const Vec3& middle, double ground)
      : angle_(twist.angle_deg.At(time) * std::numbers::pi / 180),
        from_(ground + twist.from_m),
        size_(std::max(twist.to_m - twist.from_m, 1e-6)),
        axis_(middle) {}
  void operator()(double weight, Rigid3& pose) const {
    const double share = std::clamp((pose.translation.y() - from_) / size_, 0.0, 1.0);
    const Quat turn(Eigen::AngleAxisd(weight * share * angle_, Vec3::UnitY()));
    pose = {(turn * pose.rotation).normalized(), axis_ + turn * (pose.translation - axis_)};
  }

 private:
  double angle_, from_, size_;
  Vec3 axis_;
};

class Swell {
 public:
  Swell(const SwellSettings& swell, double time, const Vec3& middle, double ground)
      : more_(swell.horizontal.At(time) - 1, swell.vertical.At(time) - 1, swell.horizontal.At(time) - 1), foot_(middle.x(), ground, middle.z()) {}
  void operator()(double weight, Rigid3& pose) const { pose.translation += weight * more_.cwiseProduct(pose.translation - foot_); }

 private:
  Vec3 more_, foot_;
};

class Wave {
 public:
  Wave(const WaveSettings& wave, double time)
      : amplitude_(wave.amplitude_m.At(time)),
        number_(2 * std::numbers::pi / wave.length_m * wave.along.normalized()),
        turned_(2 * std::numbers::pi * wave.frequency_hz.Integral(time)) {}
  void operator()(double weight, Rigid3& pose) const {
    const double phase = number_.dot(pose.translation) - turned_;
    pose.translation += weight * std::sin(phase) * amplitude_;
    // The rotation in a displacement u is half its curl.
    const Vec3 turn = 0.5 * weight * std::cos(phase) * number_.cross(amplitude_);
    pose.rotation = (FromRotationVector(turn) * pose.rotation).normalized();
  }

 private:
  Vec3 amplitude_, number_;
  double turned_;
};

}  // namespace

Distortion::Distortion(const std::vector<DistortionSettings>& settings, const MaskSubject& subject, const Vec3& take_origin)
    : settings_(settings), take_origin_(take_origin) {
  for (const DistortionSettings& setting : settings) weight_.push_back(MaskWeights(setting.mask, subject));
}

void Distortion::Apply(double time, std::vector<Rigid3>& poses) const {
  for (std::size_t d = 0; d < settings_.size(); ++d) {
    const Vec3 middle = Middle(poses);
    const double ground = take_origin_.y();
    const auto apply = [&](const auto& one) {
      for (std::size_t c = 0; c < poses.size(); ++c) {
        if (weight_[d][c] > 0) one(weight_[d][c], poses[c]);
      }
    };
    if (const auto* twist = std::get_if<TwistSettings>(&settings_[d].kind)) apply(Twist(*twist, time, middle, ground));
    if (const auto* swell = std::get_if<SwellSettings>(&settings_[d].kind)) apply(Swell(*swell, time, middle, ground));
    if (const auto* wave = std::get_if<WaveSettings>(&settings_[d].kind)) apply(Wave(*wave, time));
  }
}

}  // namespace vorocast::simulation
