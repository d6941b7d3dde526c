// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/bench/tracking_ceres.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "tests/bench/frame_problem.h"
#include "tests/bench/peer_ceres.h"

namespace vorocast::bench {
namespace {

std::map<std::string, double> QualityOf(const FrameProblem& problem, const FrameSolution& solution) {
  const double points = std::max<double>(static_cast<double>(problem.terms.size()), 1);
  return {{"energy_mm2", 1e6 * problem.Energy(solution.pose) / points},  // a point
          {"point_to_plane_rms_mm", 1000 * std::sqrt(problem.DataEnergy(solution.pose) / points)},
          {"iterations", static_cast<double>(solution.iterations)}};
}

}  // namespace

void CompareWithCeres(const geometry::Template& model, const tracking::Observation& frame, const std::vector<geometry::Rigid3>& start,
                      BenchReport& report) {
  const FrameProblem problem = MakeFrameProblem(model, frame, start);
  BenchCase one;
  one.name = "tracking-frame-solve";
  one.input = fmt::format("frame {}, {} points with fixed partners, {} patches, {} edges", frame.frame, problem.terms.size(),
                          problem.model.patch_count, problem.model.edges.size());
  double begin = CpuSeconds();
  const FrameSolution ours = SolveWithBlocks(problem);
  one.cpu_s = CpuSeconds() - begin;
  one.quality = QualityOf(problem, ours);
  begin = CpuSeconds();
  const FrameSolution theirs = SolveWithCeres(problem);
  one.peer = "Ceres 2.1, automatic derivatives, SuiteSparse";
  one.peer_cpu_s = CpuSeconds() - begin;
  one.peer_quality = QualityOf(problem, theirs);
  // The point where both arrive may differ by what the tolerance leaves.
  one.goal = {{"energy_mm2", one.peer_quality["energy_mm2"] * (1 + 10 * kEnergyTolerance)}, {"cpu_s", *one.peer_cpu_s}};
  report.Add(std::move(one));
}

}  // namespace vorocast::bench
