// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>

#include "services/base/progress.h"
#include "services/base/status.h"
#include "services/capture/capture.h"

/// Made-up captures whose truth is known. A ring of virtual depth cameras scans closed meshes in motion: what they see becomes a take as the
/// capture stage delivers it (nothing corresponds between frames, uneven density, occlusion, noise, flying pixels), and the meshes' own
/// vertices become the truth that a tracked take is held against. A folder receives
///   frame_0000.ply …  binary little endian: float x y z nx ny nz, uchar red green blue; metres, y up, points in random order
///   capture.json      name, frames_per_second, unit, up, components
///   truth.h5          storage::Truth: material points of the surface in every frame (services/storage/truth.h)
/// The same options give the same bytes.
namespace vorocast::synth {

/// How a take is scanned.
struct ScanOptions {
  std::int64_t points = 65'000;     // a frame, at most and nearly; 1000 … 5,000,000
  double noise_m = 0.001;           // standard deviation of the depth where a ray meets the surface head on; grows with the grazing angle; 0 … 0.05
  double flying_fraction = 0.001;   // of the points, hung in the air behind an edge in depth, as depth cameras do; 0 … 0.1
  double normal_noise_degrees = 4;  // standard deviation of the normals' tilt; 0 … 30
  std::int32_t cameras = 12;        // on a ring around the take, every other one from above; 3 … 64
  std::uint64_t seed = 1;

  /// INVALID_ARGUMENT names the field, its value and what it may be.
  absl::Status Validate() const;
};

/// The built-in performance: a dancer who steps and turns in a swinging skirt, with a bird cage hung from one hand (two components).
struct SynthOptions : ScanOptions {
  std::int32_t frames = 60;       // 1 … 10,000
  double frames_per_second = 25;  // 1 … 240

  absl::Status Validate() const;
};

/// What `part` says in the truth of the built-in performance.
enum class Part : std::int32_t { kHead = 0, kHair, kTorso, kLeftArm, kRightArm, kLeftLeg, kRightLeg, kShoes, kSkirt, kCage };

/// Performs and scans. `folder` is created; ALREADY_EXISTS when it holds anything. Components: the dancer and the cage, never nearer than 3 cm.
absl::Status SynthesiseCapture(const std::filesystem::path& folder, const SynthOptions& options, const base::Progress& progress = {});

/// Scans another capture: `source` is a folder of meshes of one connectivity (its unit, up, frames per second and range of frames come from
/// `source_options` as for any capture). The truth holds every vertex in every frame, in metres and y up; its part is the connected component.
/// INVALID_ARGUMENT names a frame that is a point cloud or has another connectivity; ALREADY_EXISTS when `folder` holds anything.
absl::Status ScanMeshes(const std::filesystem::path& source, const capture::CaptureOptions& source_options, const std::filesystem::path& folder,
                        const ScanOptions& options, const base::Progress& progress = {});

}  // namespace vorocast::synth
