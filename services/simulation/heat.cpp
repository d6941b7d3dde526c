// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/heat.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace vorocast::simulation {
namespace {

/// e^−z I_k(z) for k = 0, 1, … until they no longer matter, by Miller's backward recurrence: I_{k−1} = I_{k+1} + 2k/z I_k, scaled so that
/// I_0 + 2 Σ I_k = e^z.
std::vector<double> ScaledBessel(double z) {
  const auto count = static_cast<std::size_t>(std::ceil(12 + z / (1 + z / 400) * 1.5 + 9 * std::sqrt(z)));
  std::vector<double> series(count + 1);
  double above = 0;
  double here = 1e-280;
  for (std::size_t k = count + 16; k > 0; --k) {
    const double below = above + 2 * static_cast<double>(k) / z * here;
    above = here;
    here = below;
    if (k - 1 <= count) series[k - 1] = here;
    if (here > 1e200) {
      above *= 1e-200;
      here *= 1e-200;
      for (double& term : series) term *= 1e-200;
    }
  }
  const double sum = series[0] + 2 * std::accumulate(series.begin() + 1, series.end(), 0.0);
  for (double& term : series) term /= sum;
  while (series.size() > 1 && series.back() < 1e-17) series.pop_back();
  return series;
}

}  // namespace

HeatGraph::HeatGraph(const std::vector<CellEdge>& edges, const std::vector<double>& volume, Weights weights)
    : root_mass_(volume.size(), 1), row_(volume.size() + 1, 0), diagonal_(volume.size(), 0) {
  const std::size_t n = volume.size();
  const bool geometric = weights == Weights::kGeometric;
  const double mean_volume = std::accumulate(volume.begin(), volume.end(), 0.0) / static_cast<double>(n);
  constexpr double kMassFloor = 0.01;  // of the mean: a sliver would ask for a thousand terms and change nothing to see
  if (geometric) {
    for (std::size_t c = 0; c < n; ++c) root_mass_[c] = std::sqrt(std::max(volume[c] / mean_volume, kMassFloor));
  }
  std::vector<double> weight(edges.size(), 1);
  if (geometric && !edges.empty()) {
    double sum = 0;
    for (std::size_t e = 0; e < edges.size(); ++e) sum += weight[e] = edges[e].area / std::max(edges[e].distance, 1e-6);
    for (double& w : weight) w *= static_cast<double>(edges.size()) / sum;
  }
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const auto a = static_cast<std::size_t>(edges[e].a);
    const auto b = static_cast<std::size_t>(edges[e].b);
    ++row_[a + 1];
    ++row_[b + 1];
    diagonal_[a] += weight[e] / (root_mass_[a] * root_mass_[a]);
    diagonal_[b] += weight[e] / (root_mass_[b] * root_mass_[b]);
  }
  std::partial_sum(row_.begin(), row_.end(), row_.begin());
  column_.resize(2 * edges.size());
  value_.resize(2 * edges.size());
  std::vector<std::size_t> next(row_.begin(), row_.end() - 1);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const auto a = static_cast<std::size_t>(edges[e].a);
    const auto b = static_cast<std::size_t>(edges[e].b);
    const double value = weight[e] / (root_mass_[a] * root_mass_[b]);
    column_[next[a]] = edges[e].b;
    value_[next[a]++] = value;
    column_[next[b]] = edges[e].a;
    value_[next[b]++] = value;
  }
  for (std::size_t c = 0; c < n; ++c) {
    largest_ = std::max(largest_, diagonal_[c] + std::accumulate(value_.begin() + static_cast<std::ptrdiff_t>(row_[c]),
                                                                 value_.begin() + static_cast<std::ptrdiff_t>(row_[c + 1]), 0.0));
  }
}

void HeatGraph::Apply(const std::vector<double>& x, const std::vector<bool>& held, std::vector<double>& y) const {
  for (std::size_t c = 0; c < x.size(); ++c) {
    if (!held.empty() && held[c]) {
      y[c] = 0;
      continue;
    }
    double sum = diagonal_[c] * x[c];
    for (std::size_t i = row_[c]; i < row_[c + 1]; ++i) sum -= value_[i] * x[static_cast<std::size_t>(column_[i])];
    y[c] = sum;
  }
}

std::vector<double> HeatGraph::Diffuse(const std::vector<double>& temperature, double tau, const std::vector<bool>& held) const {
  const double z = 0.5 * tau * largest_;
  if (z < 1e-15) return temperature;
  // Held cells all have one temperature; what the others lack of it decays with nothing at the held ones.
  double level = 0;
  for (std::size_t c = 0; c < held.size(); ++c) {
    if (held[c]) level = temperature[c];
  }
  const std::size_t n = temperature.size();
  std::vector<double> before(n);  // T_{k−1}(X) y and T_k(X) y with X = 2/λ A − 1, whose spectrum is within [−1, 1]
  for (std::size_t c = 0; c < n; ++c) before[c] = root_mass_[c] * (temperature[c] - level);
  std::vector<double> product(n);
  const auto apply_x = [&](const std::vector<double>& x) {
    Apply(x, held, product);
    for (std::size_t c = 0; c < n; ++c) product[c] = 2 / largest_ * product[c] - x[c];
  };
  const std::vector<double> series = ScaledBessel(z);
  apply_x(before);
  std::vector<double> now = product;
  std::vector<double> sum(n);
  const double first = series.size() > 1 ? series[1] : 0;
  for (std::size_t c = 0; c < n; ++c) sum[c] = series[0] * before[c] - 2 * first * now[c];
  for (std::size_t k = 2; k < series.size(); ++k) {
    apply_x(now);
    const double factor = (k % 2 == 0 ? 2 : -2) * series[k];
    for (std::size_t c = 0; c < n; ++c) {
      const double next = 2 * product[c] - before[c];
      before[c] = now[c];
      now[c] = next;
      sum[c] += factor * next;
    }
  }
  for (std::size_t c = 0; c < n; ++c) sum[c] = sum[c] / root_mass_[c] + level;
  return sum;
}

}  // namespace vorocast::simulation
