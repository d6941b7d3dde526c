// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/optimise.h"

#include <algorithm>
#include <cmath>
#include <deque>

namespace vorocast::cvt {
namespace {

using geometry::Vec3;
using Vector = Eigen::VectorXd;

constexpr std::size_t kMemory = 7;
/// A site moves at most this many spacings in one step; further, its cell has nothing to do with the gradient any more.
constexpr double kLongestStep = 0.4;
/// Cells smaller than this share of the mean count as this large in the preconditioner, or their sites would leap.
constexpr double kSmallestMass = 0.05;
/// The first step is longer than Lloyd's, which is known to fall short.
constexpr double kFirstStep = 1.5;
constexpr double kSufficientDecrease = 1e-4;
constexpr int kBacktracks = 5;
constexpr double kGradientTolerance = 1e-7;
/// A cell below this share of the mean volume has lost its place: its site starts anew elsewhere.
constexpr double kLostCell = 1e-6;

/// The curvature that L-BFGS remembers.
class History {
 public:
  void Clear() { pairs_.clear(); }
  bool empty() const { return pairs_.empty(); }

  void Add(const Vector& step, const Vector& change) {
    const double curvature = step.dot(change);
    if (!(curvature > 1e-12 * step.norm() * change.norm())) return;
    if (pairs_.size() == kMemory) pairs_.pop_front();
    pairs_.push_back({step, change, 1 / curvature});
  }

  /// −H g by the two-loop recursion; `preconditioner` is the diagonal that stands for H without memory.
  Vector Direction(const Vector& gradient, const Vector& preconditioner) const {
    Vector q = gradient;
    std::vector<double> alpha(pairs_.size());
    for (std::size_t k = pairs_.size(); k-- > 0;) {
      alpha[k] = pairs_[k].rho * pairs_[k].step.dot(q);
      q -= alpha[k] * pairs_[k].change;
    }
    double scale = kFirstStep;
    if (!pairs_.empty()) {
      const Pair& last = pairs_.back();
      scale = 1 / (last.rho * last.change.dot(preconditioner.cwiseProduct(last.change)));
    }
    q = scale * q.cwiseProduct(preconditioner);
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      const double beta = pairs_[k].rho * pairs_[k].change.dot(q);
      q += (alpha[k] - beta) * pairs_[k].step;
    }
    return -q;
  }

 private:
  struct Pair {
    Vector step, change;
    double rho;
  };
  std::deque<Pair> pairs_;
};

class Optimiser {
 public:
  Optimiser(const Solid& solid, std::int32_t iterations, ClippedCells* cells, std::vector<Vec3>* sites, ClippedComplex* complex)
      : cells_(*cells),
        sites_(*sites),
        complex_(complex),
        iterations_(iterations),
        share_(solid.volume / static_cast<double>(sites->size())),
        spacing_(solid.Spacing(sites->size())) {}

  absl::StatusOr<OptimiseSummary> Run(const base::Progress& progress) {
    RETURN_IF_ERROR(Evaluate(iterations_ == 0));
    RETURN_IF_ERROR(ReplaceLostSites());
    Accept();
    summary_.energy_start = energy_;
    summary_.why_stopped = "iterations";
    while (summary_.iterations < iterations_) {
      if (summary_.gradient_norm * spacing_ <= kGradientTolerance * energy_) {
        summary_.why_stopped = "gradient";
        break;
      }
      ASSIGN_OR_RETURN(const bool lower, Step());
      if (!lower && history_.empty()) {
        summary_.why_stopped = "no progress";
        break;
      }
      if (!lower) {
        history_.Clear();  // what was remembered misleads; once more along the plain gradient
        continue;
      }
      ++summary_.iterations;
      base::Report(progress, static_cast<double>(summary_.iterations) / iterations_);
    }
    if (!kept_) RETURN_IF_ERROR(Evaluate(true));
    summary_.energy = energy_;
    return summary_;
  }

 private:
  absl::Status Evaluate(bool keep) {
    kept_ = keep && complex_ != nullptr;
    ++summary_.evaluations;
    return cells_.Evaluate(sites_, kept_ ? complex_ : nullptr);
  }

  /// Takes the last evaluation as the point to go on from.
  void Accept() {
    const auto n = static_cast<Eigen::Index>(sites_.size());
    energy_ = cells_.energy();
    gradient_.resize(3 * n);
    preconditioner_.resize(3 * n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const Moments& m = cells_.moments()[i];
      gradient_.segment<3>(3 * i) = -2 * m.first;  // 2 m (x − c)
      preconditioner_.segment<3>(3 * i).setConstant(0.5 / std::max(m.volume, kSmallestMass * share_));
    }
    summary_.gradient_norm = gradient_.norm();
  }

  /// One iteration: true when it has lowered the energy; false leaves everything as it was.
  absl::StatusOr<bool> Step() {
    Vector direction = history_.Direction(gradient_, preconditioner_);
    Cap(&direction);
    double slope = gradient_.dot(direction);
    if (!(slope < 0)) return false;
    const std::vector<Vec3> start = sites_;
    const Vector gradient_before = gradient_;
    // The last iteration's evaluation is also the result, if it is accepted.
    const bool last = summary_.iterations + 1 == iterations_;
    for (int backtrack = 0; backtrack <= kBacktracks; ++backtrack) {
      for (std::size_t i = 0; i < sites_.size(); ++i) sites_[i] = start[i] + direction.segment<3>(3 * static_cast<Eigen::Index>(i));
      RETURN_IF_ERROR(Evaluate(last));
      if (cells_.energy() <= energy_ + kSufficientDecrease * slope) {
        Accept();
        history_.Add(direction, gradient_ - gradient_before);
        ASSIGN_OR_RETURN(const bool moved, Settle());
        if (moved) history_.Clear();
        return true;
      }
      direction *= 0.4;
      slope *= 0.4;
    }
    sites_ = start;
    kept_ = false;
    return false;
  }

  void Cap(Vector* direction) const {
    const double longest = kLongestStep * spacing_;
    for (std::size_t i = 0; i < sites_.size(); ++i) {
      auto step = direction->segment<3>(3 * static_cast<Eigen::Index>(i));
      const double length = step.norm();
      if (length > longest) step *= longest / length;
    }
  }

  absl::StatusOr<bool> Settle() {
    if (std::ranges::none_of(cells_.moments(), [&](const Moments& m) { return m.volume < kLostCell * share_; })) return false;
    RETURN_IF_ERROR(ReplaceLostSites());
    Accept();
    return true;
  }

  /// Puts each site whose cell is empty beside the centroid of one of the largest cells, which it then shares.
  absl::Status ReplaceLostSites() {
    for (int round = 0; round < 3; ++round) {
      std::vector<std::size_t> lost;
      std::vector<std::size_t> by_volume(sites_.size());
      for (std::size_t i = 0; i < sites_.size(); ++i) {
        by_volume[i] = i;
        if (cells_.moments()[i].volume < kLostCell * share_) lost.push_back(i);
      }
      if (lost.empty()) return absl::OkStatus();
      std::ranges::stable_sort(by_volume, [&](std::size_t a, std::size_t b) { return cells_.moments()[a].volume > cells_.moments()[b].volume; });
      for (std::size_t k = 0; k < lost.size(); ++k) {
        const std::size_t host = by_volume[k % (sites_.size() - std::min(lost.size(), sites_.size() - 1))];
        const Moments& m = cells_.moments()[host];
        if (!(m.volume > 0)) break;
        const double aside = 0.05 * static_cast<double>(round + 1) * std::cbrt(m.volume);
        sites_[lost[k]] = sites_[host] + m.first / m.volume + aside * Vec3(1, 0.3, 0.1);
      }
      RETURN_IF_ERROR(Evaluate(kept_));
    }
    return absl::OkStatus();
  }

  ClippedCells& cells_;
  std::vector<Vec3>& sites_;
  ClippedComplex* complex_;
  const std::int32_t iterations_;
  const double share_;
  const double spacing_;
  OptimiseSummary summary_;
  History history_;
  double energy_ = 0;
  Vector gradient_, preconditioner_;
  bool kept_ = false;  // the last evaluation was of `sites_` and has filled the complex
};

}  // namespace

absl::StatusOr<OptimiseSummary> Optimise(const Solid& solid, std::int32_t iterations, ClippedCells* cells, std::vector<Vec3>* sites,
                                         ClippedComplex* complex, const base::Progress& progress) {
  return Optimiser(solid, iterations, cells, sites, complex).Run(progress);
}

}  // namespace vorocast::cvt
