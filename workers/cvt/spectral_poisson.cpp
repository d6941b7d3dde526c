// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/spectral_poisson.h"

#include <fftw3.h>

#include <cmath>
#include <memory>
#include <mutex>
#include <numbers>

#include "services/base/check.h"

namespace vorocast::cvt {
namespace {

struct FftwFree {
  void operator()(void* memory) const { fftwf_free(memory); }
};
using Spectrum = std::unique_ptr<fftwf_complex[], FftwFree>;
using Samples = std::unique_ptr<float[], FftwFree>;

/// FFTW's planner has global state; only executing a plan is safe from several threads.
std::mutex& PlannerMutex() {
  static std::mutex mutex;
  return mutex;
}

class Plan {
 public:
  // FFTW_ESTIMATE: measuring would choose by the clock, and so make the last bits depend on the machine's load.
  Plan(const GridFrame& frame, float* samples, fftwf_complex* spectrum) {
    const std::scoped_lock lock(PlannerMutex());
    plan_ = fftwf_plan_dft_r2c_3d(frame.nodes[0], frame.nodes[1], frame.nodes[2], samples, spectrum, FFTW_ESTIMATE);
    VOROCAST_CHECK(plan_ != nullptr);
  }
  Plan(const GridFrame& frame, fftwf_complex* spectrum, float* samples) {
    const std::scoped_lock lock(PlannerMutex());
    plan_ = fftwf_plan_dft_c2r_3d(frame.nodes[0], frame.nodes[1], frame.nodes[2], spectrum, samples, FFTW_ESTIMATE);
    VOROCAST_CHECK(plan_ != nullptr);
  }
  Plan(const Plan&) = delete;
  Plan& operator=(const Plan&) = delete;
  ~Plan() {
    const std::scoped_lock lock(PlannerMutex());
    fftwf_destroy_plan(plan_);
  }
  void Execute() const { fftwf_execute(plan_); }

 private:
  fftwf_plan plan_;
};

/// Weights of the cubic B-spline at the four nodes around a position, and their derivatives with respect to the node's coordinate.
struct CubicSpline {
  std::int32_t first;
  std::array<float, 4> weight;
  std::array<float, 4> slope;

  explicit CubicSpline(float x) {
    const float below = std::floor(x);
    const float t = x - below;
    const float s = 1 - t;
    first = static_cast<std::int32_t>(below) - 1;
    weight = {s * s * s / 6, (4 - 6 * t * t + 3 * t * t * t) / 6, (4 - 6 * s * s + 3 * s * s * s) / 6, t * t * t / 6};
    slope = {s * s / 2, (4 * t - 3 * t * t) / 2, (3 * s * s - 4 * s) / 2, -t * t / 2};
  }
};

/// The divergence of the normal field Σ area n B(x − p), B the cubic B-spline: spreading the divergence instead of the normals takes one
/// transform instead of three.
void SplatDivergence(const GridFrame& frame, const SortedPoints& points, float* divergence) {
  for (const GridPoint& p : points.points()) {
    const CubicSpline x(p.u[0]);
    const CubicSpline y(p.u[1]);
    const CubicSpline z(p.u[2]);
    const geometry::Vec3f flux = p.area * p.normal;
    for (std::int32_t i = 0; i < 4; ++i) {
      const std::size_t a = static_cast<std::size_t>(i);
      for (std::int32_t j = 0; j < 4; ++j) {
        const std::size_t b = static_cast<std::size_t>(j);
        const float across = flux[0] * x.slope[a] * y.weight[b] + flux[1] * x.weight[a] * y.slope[b];
        const float along = flux[2] * x.weight[a] * y.weight[b];
        float* row = divergence + frame.Index(x.first + i, y.first + j, z.first);
        for (std::size_t c = 0; c < 4; ++c) row[c] += across * z.weight[c] + along * z.slope[c];
      }
    }
  }
}

/// Angular frequencies squared and Gaussian factors of one axis.
struct AxisSpectrum {
  std::vector<float> k_squared;
  std::vector<float> damping;

  AxisSpectrum(std::int32_t nodes, double variance) {
    for (std::int32_t m = 0; m < nodes; ++m) {
      const double k = 2 * std::numbers::pi * (m <= nodes / 2 ? m : m - nodes) / nodes;
      k_squared.push_back(static_cast<float>(k * k));
      damping.push_back(static_cast<float>(std::exp(-0.5 * variance * k * k)));
    }
  }
};

/// χ̂ = G D̂ / |k|² for Δχ = −D; the mean, which the equation leaves free, becomes 0.
void InvertLaplacian(const GridFrame& frame, double variance, fftwf_complex* spectrum) {
  const AxisSpectrum x(frame.nodes[0], variance);
  const AxisSpectrum y(frame.nodes[1], variance);
  const AxisSpectrum z(frame.nodes[2], variance);
  const std::size_t half = static_cast<std::size_t>(frame.nodes[2] / 2 + 1);
  const float normalisation = 1.0F / static_cast<float>(frame.size());
  fftwf_complex* row = spectrum;
  for (std::size_t i = 0; i < x.k_squared.size(); ++i) {
    for (std::size_t j = 0; j < y.k_squared.size(); ++j, row += half) {
      const float k_squared = x.k_squared[i] + y.k_squared[j];
      const float damping = normalisation * x.damping[i] * y.damping[j];
      for (std::size_t k = 0; k < half; ++k) {
        const float factor = damping * z.damping[k] / (k_squared + z.k_squared[k]);
        row[k][0] *= factor;
        row[k][1] *= factor;
      }
    }
  }
  spectrum[0][0] = 0;
  spectrum[0][1] = 0;
}

}  // namespace

ScalarGrid SolveSpectralPoisson(const GridFrame& frame, const SortedPoints& points, double smoothing) {
  const std::size_t half = static_cast<std::size_t>(frame.nodes[2] / 2 + 1);
  const std::size_t spectrum_size = static_cast<std::size_t>(frame.nodes[0]) * static_cast<std::size_t>(frame.nodes[1]) * half;
  const Samples samples(fftwf_alloc_real(frame.size()));
  const Spectrum spectrum(fftwf_alloc_complex(spectrum_size));
  VOROCAST_CHECK(samples != nullptr && spectrum != nullptr);
  const Plan forward(frame, samples.get(), spectrum.get());
  const Plan backward(frame, spectrum.get(), samples.get());

  std::fill_n(samples.get(), frame.size(), 0.0F);
  SplatDivergence(frame, points, samples.get());
  forward.Execute();
  constexpr double kSplineVariance = 1.0 / 3;
  InvertLaplacian(frame, std::max(0.0, smoothing * smoothing - kSplineVariance), spectrum.get());
  backward.Execute();
  return {frame, std::vector<float>(samples.get(), samples.get() + frame.size())};
}

}  // namespace vorocast::cvt
