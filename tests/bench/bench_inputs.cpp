// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/bench/bench_inputs.h"

#include <fmt/format.h>
#include <unistd.h>

#include <system_error>

#include "services/base/random.h"
#include "services/capture/frame_reader.h"
#include "services/synth/synth.h"
#include "tests/bench/bench_report.h"

namespace vorocast::bench {

using geometry::OrientedPoints;
using geometry::TriangleMesh;

ScratchFolder::ScratchFolder(const std::string& name) : path_(std::filesystem::temp_directory_path() / fmt::format("{}_{}", name, getpid())) {}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

OrientedPoints Scan(const TriangleMesh& mesh, std::size_t count, double noise_m, std::uint64_t seed) {
  OrientedPoints points = geometry::SampleSurface(mesh, count, seed);
  base::Random random(seed + 1000);
  for (std::size_t p = 0; p < points.size(); ++p) points.positions[p] += noise_m * random.Gaussian() * points.normals[p];
  return points;
}

absl::StatusOr<BenchFrame> CraneFrame(std::int32_t frame, std::size_t points) {
  const std::filesystem::path path = std::filesystem::path(DataFolder()) / "crane" / fmt::format("frame_{:04}.ply", frame);
  if (!std::filesystem::exists(path))
    return absl::NotFoundError(fmt::format("{}: no such file; VOROCAST_DATA names the folder of captures", path.string()));
  ASSIGN_OR_RETURN(capture::Frame read, capture::ReadFrame(path, {}));
  BenchFrame result{fmt::format("crane {}", frame), Scan(read.mesh, points, kScanNoise_m, 1), std::nullopt};
  result.truth = std::move(read.mesh);
  return result;
}

absl::StatusOr<BenchFrame> KinopticFrame(std::int32_t frame) {
  const std::filesystem::path path = std::filesystem::path(DataFolder()) / "kinoptic" / fmt::format("ptcloud_hd{:08}.ply", frame);
  if (!std::filesystem::exists(path))
    return absl::NotFoundError(fmt::format("{}: no such file; VOROCAST_DATA names the folder of captures", path.string()));
  ASSIGN_OR_RETURN(capture::Frame read, capture::ReadFrame(path, {.metres_per_unit = 0.01, .up = "-y"}));
  return BenchFrame{fmt::format("kinoptic {}", frame), std::move(read.points), std::nullopt};
}

absl::StatusOr<BenchFrame> SynthFrame(std::size_t points) {
  const ScratchFolder folder("vorocast_bench_synth");
  synth::SynthOptions options;
  options.frames = 1;
  options.points = static_cast<std::int64_t>(points);
  RETURN_IF_ERROR(synth::SynthesiseCapture(folder.path(), options));
  ASSIGN_OR_RETURN(capture::Frame read, capture::ReadFrame(folder.path() / "frame_0000.ply", {}));
  return BenchFrame{"synth 0", std::move(read.points), std::nullopt};
}

absl::StatusOr<BenchFrame> CraneOrSynthFrame(std::int32_t frame, std::size_t points) {
  absl::StatusOr<BenchFrame> crane = CraneFrame(frame, points);
  return absl::IsNotFound(crane.status()) ? SynthFrame(points) : std::move(crane);
}

}  // namespace vorocast::bench
