// SPDX-License-Identifier: AGPL-3.0-or-later
// How far a tracked take is from the truth: evaluate_tracking tracked.h5 truth.h5 [FIRST_FRAME] [--json FILE]
//
// The truth's material points at the template's frame are attached to the template's cells and carried along by the stored poses; what is
// printed is their distance to where the truth says they are. FIRST_FRAME is the truth's row that the take's frame 0 stands for (0).
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <map>
#include <numeric>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "services/storage/hdf5_artifacts.h"
#include "services/storage/truth.h"

namespace vorocast {
namespace {

using geometry::Vec3;

constexpr std::size_t kAnchors = 4;

/// A material point in the template and the cells nearest to it, with weights that fall with the distance.
struct Anchored {
  Vec3 point;
  std::array<std::size_t, kAnchors> cell{};
  std::array<double, kAnchors> weight{};
};

Anchored Anchor(const geometry::Cells& cells, const Vec3& point) {
  std::vector<std::size_t> order(cells.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const std::size_t count = std::min(kAnchors, cells.size());
  const auto distance = [&](std::size_t c) { return (cells.centroid[c] - point).squaredNorm(); };
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count), order.end(),
                    [&](std::size_t a, std::size_t b) { return distance(a) < distance(b); });
  Anchored anchored{point, {}, {}};
  double sum = 0;
  for (std::size_t i = 0; i < count; ++i) {
    // Cells of another body may be near by chance; they do not carry the point.
    if (cells.component[order[i]] != cells.component[order[0]]) continue;
    anchored.cell[i] = order[i];
    anchored.weight[i] = 1 / (distance(order[i]) + 1e-6);
    sum += anchored.weight[i];
  }
  for (double& w : anchored.weight) w /= sum;
  return anchored;
}

Vec3 Carry(const geometry::TrackedTake& take, std::size_t frame, const Anchored& anchored) {
  Vec3 carried = Vec3::Zero();
  for (std::size_t i = 0; i < kAnchors; ++i) {
    if (anchored.weight[i] > 0) carried += anchored.weight[i] * (take.CellPose(frame, anchored.cell[i]) * anchored.point);
  }
  return carried;
}

struct Score {
  double mean = 0, p95 = 0, max = 0;
};

Score ScoreOf(std::vector<double> distances) {
  if (distances.empty()) return {};
  std::ranges::sort(distances);
  const double mean = std::accumulate(distances.begin(), distances.end(), 0.0) / static_cast<double>(distances.size());
  return {mean, distances[static_cast<std::size_t>(0.95 * static_cast<double>(distances.size() - 1))], distances.back()};
}

absl::Status Evaluate(const char* tracked_path, const char* truth_path, std::int32_t first_frame, const std::string& json_file) {
  ASSIGN_OR_RETURN(const geometry::TrackedTake take, storage::ReadTrackedTake(tracked_path));
  ASSIGN_OR_RETURN(const storage::Truth truth, storage::ReadTruth(truth_path));
  const std::size_t count = truth.part.size();
  const auto row = [&](std::int32_t frame) { return static_cast<std::size_t>(first_frame + frame); };
  if (row(take.patches.frames.back()) >= truth.points.size()) return absl::InvalidArgumentError("the truth has fewer frames than the take");

  std::vector<Anchored> anchored;
  for (std::size_t k = 0; k < count; ++k) anchored.push_back(Anchor(take.model.cells, truth.points[row(take.model.frame)][k]));

  fmt::print("template: frame {}, {} cells, {} material points\n", take.model.frame, take.cell_count(), count);
  fmt::print("{:>6} {:>9} {:>9} {:>9} {:>10} {:>11}\n", "frame", "mean mm", "95 % mm", "max mm", "residual", "confidence");
  std::vector<double> all;
  std::map<std::int32_t, std::vector<double>> by_part;
  for (std::size_t f = 0; f < take.frame_count(); ++f) {
    const std::int32_t frame = take.patches.frames[f];
    std::vector<double> distances;
    for (std::size_t k = 0; k < count; ++k) {
      distances.push_back(1000 * (Carry(take, f, anchored[k]) - truth.points[row(frame)][k]).norm());
      by_part[truth.part[k]].push_back(distances.back());
    }
    const Score score = ScoreOf(distances);
    fmt::print("{:>6} {:>9.2f} {:>9.2f} {:>9.2f} {:>7.2f} mm {:>11.2f}{}\n", frame, score.mean, score.p95, score.max, 1000 * take.patches.residual[f],
               take.patches.confidence[f], take.patches.state[f] == geometry::FrameState::kInterpolated ? "  interpolated" : "");
    all.insert(all.end(), distances.begin(), distances.end());
  }
  for (const auto& [part, distances] : by_part) {
    const Score score = ScoreOf(distances);
    fmt::print("part {:>2}: mean {:.2f} mm, 95 % {:.2f} mm, max {:.2f} mm\n", part, score.mean, score.p95, score.max);
  }
  const Score score = ScoreOf(all);
  fmt::print("all: mean {:.2f} mm, 95 % {:.2f} mm, max {:.2f} mm over {} frames\n", score.mean, score.p95, score.max, take.frame_count());
  const nlohmann::json json = {
      {"file", tracked_path}, {"frames", take.frame_count()}, {"mean_mm", score.mean}, {"p95_mm", score.p95}, {"max_mm", score.max}};
  if (!json_file.empty() && !(std::ofstream(json_file) << json.dump(2) << "\n")) return absl::UnknownError(json_file + " cannot be written");
  return absl::OkStatus();
}

}  // namespace
}  // namespace vorocast

int main(int argc, char** argv) {
  std::vector<const char*> arguments;
  std::string json_file;
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--json" && i + 1 < argc) {
      json_file = argv[++i];
    } else {
      arguments.push_back(argv[i]);
    }
  }
  if (arguments.size() < 2) {
    fmt::print(stderr, "usage: evaluate_tracking tracked.h5 truth.h5 [FIRST_FRAME] [--json FILE]\n");
    return 2;
  }
  const absl::Status status = vorocast::Evaluate(arguments[0], arguments[1], arguments.size() > 2 ? std::atoi(arguments[2]) : 0, json_file);
  if (!status.ok()) fmt::print(stderr, "evaluate_tracking: {}\n", std::string(status.message()));
  return status.ok() ? 0 : 1;
}
