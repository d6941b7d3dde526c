// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/force_fields.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "services/base/check.h"

namespace vorocast::simulation {
namespace {

using geometry::Vec3;

constexpr double kSoftening = 0.05;  // metres: an attractor's pull fades to nothing at its very middle

struct Wave {
  Vec3 number;     // radians a length
  Vec3 amplitude;  // across it
  double frequency;
  double phase;
};

/// Directions spread over the half sphere by the golden angle; lengths, frequencies and phases by its multiples: irregular, and written down once.
std::array<Wave, 8> MakeWaves() {
  std::array<Wave, 8> waves{};
  constexpr double kGolden = 2.399963229728653;
  for (std::size_t i = 0; i < waves.size(); ++i) {
    const double k = static_cast<double>(i);
    const double y = (k + 0.5) / static_cast<double>(waves.size());
    const double r = std::sqrt(1 - y * y);
    const Vec3 direction(r * std::cos(kGolden * k), y, r * std::sin(kGolden * k));
    const double length = 0.6 + 0.8 * std::fmod(0.618034 * (k + 1), 1.0);
    const Vec3 across = direction.unitOrthogonal();
    const double turn = 1.7 * kGolden * k;
    const Vec3 amplitude = std::cos(turn) * across + std::sin(turn) * direction.cross(across);
    waves[i] = {2 * std::numbers::pi / length * direction, amplitude * std::sqrt(2.0 / static_cast<double>(waves.size())),
                2 * std::numbers::pi * (0.5 + std::fmod(0.381966 * (k + 1), 1.0)), 5.1 * k};
  }
  return waves;
}

}  // namespace

Vec3 Turbulence(const Vec3& position, double time) {
  static const std::array<Wave, 8> waves = MakeWaves();
  Vec3 flow = Vec3::Zero();
  for (const Wave& wave : waves) flow += std::cos(wave.number.dot(position) - wave.frequency * time + wave.phase) * wave.amplitude;
  return flow;
}

ForceFields::ForceFields(const std::vector<FieldSettings>& settings, const MaskSubject& subject, const Vec3& take_origin)
    : settings_(settings), take_origin_(take_origin), now_(settings.size()) {
  for (const FieldSettings& field : settings) weight_.push_back(MaskWeights(field.mask, subject));
}

void ForceFields::Advance(double time) {
  for (std::size_t f = 0; f < settings_.size(); ++f) {
    if (const auto* attractor = std::get_if<AttractorSettings>(&settings_[f].kind)) {
      const Vec3 origin = attractor->origin_is_take ? take_origin_ : Vec3(Vec3::Zero());
      now_[f] = {
          .vector = attractor->position_m.At(time) + origin, .strength = attractor->strength_m_s2.At(time), .drag = attractor->drag_s.At(time)};
    } else {
      const auto* wind = std::get_if<WindSettings>(&settings_[f].kind);
      VOROCAST_CHECK(wind != nullptr);
      now_[f] = {.vector = wind->velocity_m_s.At(time),
                 .drag = wind->drag_s.At(time),
                 .turbulence = wind->turbulence.At(time),
                 .carried = wind->velocity_m_s.Integral(time)};
    }
  }
}

FieldPush ForceFields::At(std::size_t c, const Vec3& position, bool recalled) const {
  FieldPush push;
  for (std::size_t f = 0; f < settings_.size(); ++f) {
    const double weight = weight_[f][c];
    if (weight == 0 || (recalled && !settings_[f].acts_on_recalled)) continue;
    const Now& now = now_[f];
    if (const auto* attractor = std::get_if<AttractorSettings>(&settings_[f].kind)) {
      const Vec3 way = now.vector - position;
      const double distance = std::sqrt(way.squaredNorm() + kSoftening * kSoftening);
      const double falloff = attractor->reach_m > 0 ? std::max(0.0, 1 - distance / attractor->reach_m) : 1;
      if (now.strength == 0 || falloff == 0) continue;
      push.acceleration += weight * falloff * now.strength / distance * way;
      push.drag += weight * falloff * now.drag;
    } else {
      const auto& wind = std::get<WindSettings>(settings_[f].kind);
      Vec3 flow = now.vector;
      const double speed = flow.norm();
      if (now.drag == 0 || speed == 0) continue;
      if (now.turbulence > 0) {
        // Eddies drift with the wind, and turn over as they go.
        const double size = wind.turbulence_size_m;
        flow += now.turbulence * speed * Turbulence((position - now.carried) / size, 0.5 * now.carried.norm() / size);
      }
      push.acceleration += weight * now.drag * flow;
      push.drag += weight * now.drag;
    }
  }
  return push;
}

}  // namespace vorocast::simulation
