// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/persistence.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace vorocast::simulation {
namespace {

using geometry::CellState;
using geometry::Quat;
using geometry::SimulatedTake;
using geometry::Vec3;
using From = PersistenceSettings::From;

constexpr std::size_t kRowsMax = 40'000'000;
constexpr double kEarly = 1e-9;

/// Which cells go first: 0 the first, 1 the last. [n]
std::vector<double> Order(From from, const MaskSubject& subject) {
  const bool by_depth = from == From::kOutside || from == From::kInside;
  const std::vector<double>& value = by_depth ? subject.model.cells.depth : subject.height;
  const double most = std::max(*std::ranges::max_element(value), 1e-9);
  const bool ascending = from == From::kOutside || from == From::kBottom;
  std::vector<double> order;
  for (const double v : value) order.push_back(std::clamp(ascending ? v / most : 1 - v / most, 0.0, 1.0));
  return order;
}

/// A cell as it was at a time between two stored instants.
struct Moment {
  std::size_t before;
  double share;  // of the way to the next instant
};
Moment MomentOf(const std::vector<double>& times, double time) {
  const auto after = static_cast<std::size_t>(std::ranges::upper_bound(times, time + kEarly) - times.begin());
  const std::size_t before = after == 0 ? 0 : after - 1;
  if (before + 1 >= times.size()) return {times.size() - 1, 0};
  return {before, std::clamp((time - times[before]) / (times[before + 1] - times[before]), 0.0, 1.0)};
}

class Copier {
 public:
  Copier(const PersistenceSettings& settings, const MaskSubject& subject, SimulatedTake& result)
      : settings_(settings), centroid_(subject.model.cells.centroid), result_(result), order_(Order(settings.erode_from, subject)) {
    weight_ = MaskWeights(settings.mask, subject);
  }

  /// The copy that was left at `birth`, as it is at the stored instant `step`.
  void Add(std::size_t step, double birth, std::int32_t number) {
    const double age = result_.time[step] - birth;
    const Moment moment = MomentOf(result_.time, birth + settings_.speed.Integral(age));
    const Vec3 drift = settings_.drift_m_s.Integral(age);
    for (std::size_t c = 0; c < centroid_.size(); ++c) {
      const double scale = Scale(c, age);
      if (scale > 0 && weight_[c] >= 0.5) AddCell(c, moment, drift, scale, number);
    }
  }

 private:
  double Scale(std::size_t c, double age) const {
    const double wearing = std::max(settings_.lifetime_s - settings_.erode_start_s - settings_.vanish_s, 0.0);
    const double since = age - settings_.erode_start_s - order_[c] * wearing;
    if (since <= 0) return 1;
    return since < settings_.vanish_s ? 1 - since / settings_.vanish_s : 0;
  }

  Quat RotationAt(std::size_t i) const {
    const Eigen::Vector4f& q = result_.cell_rotation[i];
    return Quat(q[0], q[1], q[2], q[3]).normalized();
  }

  void AddCell(std::size_t c, const Moment& moment, const Vec3& drift, double scale, std::int32_t number) {
    const std::size_t n = centroid_.size();
    const std::size_t i = moment.before * n + c;
    if (result_.cell_state[i] == CellState::kGone) return;
    if (!result_.cell_scale.empty()) scale *= result_.cell_scale[i];
    Quat rotation = RotationAt(i);
    Vec3 centre = rotation * centroid_[c] + result_.cell_translation[i];
    if (moment.share > 0) {
      const Quat next = RotationAt(i + n);
      centre = (1 - moment.share) * centre + moment.share * (next * centroid_[c] + result_.cell_translation[i + n]);
      rotation = rotation.slerp(moment.share, next);
    }
    geometry::CellCopies& copies = result_.copies;
    const Eigen::Vector4f stored = Eigen::Vector4d(rotation.w(), rotation.x(), rotation.y(), rotation.z()).cast<float>().normalized();
    const Quat as_stored = Quat(stored[0], stored[1], stored[2], stored[3]).normalized();
    copies.copy.push_back(number);
    copies.cell.push_back(static_cast<std::int32_t>(c));
    copies.rotation.push_back(stored);
    copies.translation.push_back((centre + drift - as_stored * centroid_[c]).cast<float>());
    copies.scale.push_back(static_cast<float>(scale));
  }

  const PersistenceSettings& settings_;
  const std::vector<Vec3>& centroid_;
  SimulatedTake& result_;
  const std::vector<double> order_;
  std::vector<double> weight_;
};

}  // namespace

absl::Status AddCopies(const std::vector<PersistenceSettings>& settings, const MaskSubject& subject, SimulatedTake& result) {
  if (settings.empty() || result.time.empty()) return absl::OkStatus();
  const double last = result.time.back();
  std::vector<Copier> copiers;
  for (const PersistenceSettings& one : settings) copiers.emplace_back(one, subject, result);
  result.copies.offset.assign(1, 0);
  for (std::size_t s = 0; s < result.time.size(); ++s) {
    std::int32_t number = 0;
    for (std::size_t p = 0; p < settings.size(); ++p) {
      const PersistenceSettings& one = settings[p];
      for (std::size_t k = 0;; ++k, ++number) {
        const double birth = one.start_s + static_cast<double>(k) * one.interval_s;
        if (birth > std::min(one.end_s, last) + kEarly) break;
        const double age = result.time[s] - birth;
        if (age > kEarly && age < one.lifetime_s) copiers[p].Add(s, birth, number);
      }
    }
    if (result.copies.cell.size() > kRowsMax) {
      return absl::InvalidArgumentError(fmt::format(
          "effect: persistence: more than {} copied cells over all stored frames; use a longer interval_s, a shorter lifetime_s or a mask",
          kRowsMax));
    }
    result.copies.offset.push_back(static_cast<std::int64_t>(result.copies.cell.size()));
  }
  return absl::OkStatus();
}

}  // namespace vorocast::simulation
