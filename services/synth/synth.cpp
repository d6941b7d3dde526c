// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/synth.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "services/storage/truth.h"
#include "services/synth/capture_folder.h"
#include "services/synth/depth_cameras.h"
#include "services/synth/performance.h"

namespace vorocast::synth {
namespace {

using geometry::Vec3;

constexpr std::size_t kMaterialPoints = 4000;
constexpr std::int32_t kFramesLookedAt = 16;  // spread over the take, to learn where it moves and what the cameras see of it

template <typename T>
absl::Status CheckRange(const char* field, T value, T low, T high) {
  if (value >= low && value <= high) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format("{} is {}; it must be from {} to {}", field, value, low, high));
}

std::vector<std::int32_t> FramesLookedAt(std::int32_t frame_count) {
  const std::int32_t count = std::min(frame_count, kFramesLookedAt);
  std::vector<std::int32_t> frames;
  for (std::int32_t i = 0; i < count; ++i) frames.push_back(static_cast<std::int32_t>(static_cast<std::int64_t>(i) * frame_count / count));
  return frames;
}

geometry::Box3 BoundsOf(const Performance& performance) {
  geometry::Box3 bounds;
  for (const std::int32_t frame : FramesLookedAt(performance.frame_count())) {
    for (const Vec3& x : performance.VerticesAt(frame)) bounds.extend(x);
  }
  return bounds;
}

/// The vertices whose way the truth tells, in ascending order. Those that are mostly hidden (below the skirt, inside the waist) are no use to hold
/// a tracker against, for it never sees them.
std::vector<std::size_t> ChooseMaterialPoints(const Performance& performance, DepthScanner& scanner, std::uint64_t seed) {
  std::vector<std::size_t> chosen;
  if (performance.every_vertex_counts()) {
    for (std::size_t v = 0; v < performance.surface().vertices.size(); ++v) chosen.push_back(v);
    return chosen;
  }
  const std::vector<std::int32_t> frames = FramesLookedAt(performance.frame_count());
  std::vector<std::size_t> times_seen(performance.surface().vertices.size(), 0);
  for (const std::int32_t frame : frames) {
    const std::vector<char> seen = scanner.Seen(performance.VerticesAt(frame));
    for (std::size_t v = 0; v < seen.size(); ++v) times_seen[v] += seen[v] ? 1 : 0;
  }
  for (std::size_t v = 0; v < times_seen.size(); ++v) {
    if (2 * times_seen[v] >= frames.size()) chosen.push_back(v);
  }
  base::Random random(seed);
  for (std::size_t i = chosen.size(); i > 1; --i) std::swap(chosen[i - 1], chosen[random.Below(i)]);
  chosen.resize(std::min(chosen.size(), kMaterialPoints));
  std::ranges::sort(chosen);
  return chosen;
}

absl::Status ScanPerformance(const Performance& performance, const std::filesystem::path& folder, const ScanOptions& options,
                             const base::Progress& progress) {
  DepthScanner scanner(performance.surface(), BoundsOf(performance), options);
  scanner.Calibrate(performance.VerticesAt(0));
  const std::vector<std::size_t> material = ChooseMaterialPoints(performance, scanner, options.seed);

  storage::Truth truth{.frames_per_second = performance.frames_per_second()};
  for (const std::size_t v : material) truth.part.push_back(performance.part()[v]);
  for (std::int32_t frame = 0; frame < performance.frame_count(); ++frame) {
    const std::vector<Vec3> vertices = performance.VerticesAt(frame);
    RETURN_IF_ERROR(WritePly(folder / FrameName(frame), scanner.Scan(vertices, frame)));
    std::vector<Vec3>& points = truth.points.emplace_back();
    for (const std::size_t v : material) points.push_back(vertices[v]);
    base::Report(progress, (frame + 1.0) / performance.frame_count());
  }
  RETURN_IF_ERROR(storage::WriteTruth(folder / "truth.h5", truth));
  return WriteDescription(folder / "capture.json", {performance.name(), performance.frames_per_second(), performance.components()});
}

}  // namespace

absl::Status ScanOptions::Validate() const {
  RETURN_IF_ERROR(CheckRange<std::int64_t>("points", points, 1000, 5'000'000));
  RETURN_IF_ERROR(CheckRange("noise_m", noise_m, 0.0, 0.05));
  RETURN_IF_ERROR(CheckRange("flying_fraction", flying_fraction, 0.0, 0.1));
  RETURN_IF_ERROR(CheckRange("normal_noise_degrees", normal_noise_degrees, 0.0, 30.0));
  return CheckRange<std::int32_t>("cameras", cameras, 3, 64);
}

absl::Status SynthOptions::Validate() const {
  RETURN_IF_ERROR(ScanOptions::Validate());
  RETURN_IF_ERROR(CheckRange<std::int32_t>("frames", frames, 1, 10'000));
  return CheckRange("frames_per_second", frames_per_second, 1.0, 240.0);
}

absl::Status SynthesiseCapture(const std::filesystem::path& folder, const SynthOptions& options, const base::Progress& progress) {
  RETURN_IF_ERROR(options.Validate());
  RETURN_IF_ERROR(PrepareFolder(folder));
  return ScanPerformance(Dance(options.frames, options.frames_per_second), folder, options, progress);
}

absl::Status ScanMeshes(const std::filesystem::path& source, const capture::CaptureOptions& source_options, const std::filesystem::path& folder,
                        const ScanOptions& options, const base::Progress& progress) {
  RETURN_IF_ERROR(options.Validate());
  ASSIGN_OR_RETURN(const MeshCapture performance, MeshCapture::Open(source, source_options));
  RETURN_IF_ERROR(PrepareFolder(folder));
  return ScanPerformance(performance, folder, options, progress);
}

}  // namespace vorocast::synth
