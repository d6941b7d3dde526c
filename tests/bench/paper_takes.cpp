// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/bench/paper_takes.h"

#include <fmt/format.h>

#include "services/capture/frame_reader.h"
#include "services/synth/synth.h"
#include "tests/bench/bench_inputs.h"
#include "tests/bench/bench_report.h"

namespace vorocast::bench {
namespace {

constexpr std::int64_t kCranePoints = 75'000;

absl::StatusOr<PaperTake> Synth(const std::filesystem::path& folder, std::int32_t frames) {
  synth::SynthOptions options;
  options.frames = frames;
  options.points = kPaperPoints;
  RETURN_IF_ERROR(synth::SynthesiseCapture(folder, options));
  ASSIGN_OR_RETURN(capture::Capture capture, capture::OpenCapture(folder, {}));
  return PaperTake{"synth", std::move(capture), folder / "truth.h5"};
}

absl::StatusOr<PaperTake> Crane(const std::filesystem::path& source, const std::filesystem::path& folder, std::int32_t frames) {
  capture::CaptureOptions range;
  range.last = frames;
  synth::ScanOptions options;
  options.points = kCranePoints;
  options.noise_m = kScanNoise_m;
  RETURN_IF_ERROR(synth::ScanMeshes(source, range, folder, options));
  ASSIGN_OR_RETURN(capture::Capture capture, capture::OpenCapture(folder, {}));
  return PaperTake{"crane", std::move(capture), folder / "truth.h5"};
}

absl::StatusOr<PaperTake> Kinoptic(const std::filesystem::path& source, std::int32_t frames) {
  capture::CaptureOptions options;
  options.unit = "cm";
  options.up = "-y";
  options.last = frames;
  ASSIGN_OR_RETURN(capture::Capture capture, capture::OpenCapture(source, options));
  return PaperTake{"kinoptic", std::move(capture), {}};
}

}  // namespace

absl::StatusOr<std::vector<PaperTake>> OpenPaperTakes(const std::filesystem::path& scratch, std::int32_t frames) {
  std::vector<PaperTake> takes;
  ASSIGN_OR_RETURN(PaperTake synth, Synth(scratch / "synth", frames));
  takes.push_back(std::move(synth));
  const std::filesystem::path data = DataFolder();
  const auto is_there = [&](const char* name) {
    if (std::filesystem::is_directory(data / name)) return true;
    fmt::print("{} is left out: no capture in {}; VOROCAST_DATA names the folder of captures\n", name, (data / name).string());
    return false;
  };
  if (is_there("kinoptic")) {
    ASSIGN_OR_RETURN(PaperTake kinoptic, Kinoptic(data / "kinoptic", frames));
    takes.push_back(std::move(kinoptic));
  }
  if (is_there("crane")) {
    ASSIGN_OR_RETURN(PaperTake crane, Crane(data / "crane", scratch / "crane", frames));
    takes.push_back(std::move(crane));
  }
  return takes;
}

absl::StatusOr<geometry::OrientedPoints> ReadPoints(const PaperTake& take, std::size_t frame) {
  ASSIGN_OR_RETURN(capture::Frame read,
                   capture::ReadFrame(take.capture.frames.at(frame).path, {.metres_per_unit = take.capture.metres_per_unit, .up = take.capture.up}));
  return std::move(read.points);
}

}  // namespace vorocast::bench
