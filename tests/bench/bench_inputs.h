// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "services/base/status.h"
#include "services/geometry/oriented_points.h"
#include "services/geometry/triangle_mesh.h"

namespace vorocast::bench {

/// The points of the paper's dancer (its Table 1), and the noise that scans of known meshes are given.
inline constexpr std::size_t kPaperPoints = 65'386;
inline constexpr double kScanNoise_m = 0.001;

/// One frame to be measured on, and the surface it was scanned from where that is known.
struct BenchFrame {
  std::string name;  // "crane 40"
  geometry::OrientedPoints points;
  std::optional<geometry::TriangleMesh> truth;
};

/// A folder of this process that is removed at the end; made-up captures go there.
class ScratchFolder {
 public:
  explicit ScratchFolder(const std::string& name);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// Points of a mesh, uniform by area, moved along their normals by Gaussian noise.
geometry::OrientedPoints Scan(const geometry::TriangleMesh& mesh, std::size_t count, double noise_m, std::uint64_t seed);

/// A frame of the crane capture, scanned; NOT_FOUND where the capture is absent.
absl::StatusOr<BenchFrame> CraneFrame(std::int32_t frame, std::size_t points);
/// A frame (380 … 400) of the kinoptic capture, fuzzy points of depth cameras in centimetres and y down; NOT_FOUND where it is absent.
absl::StatusOr<BenchFrame> KinopticFrame(std::int32_t frame);
/// The first frame of a made-up take: a dancer and a cage, two components.
absl::StatusOr<BenchFrame> SynthFrame(std::size_t points);
/// Crane's, or, where that is absent, the made-up one.
absl::StatusOr<BenchFrame> CraneOrSynthFrame(std::int32_t frame, std::size_t points);

}  // namespace vorocast::bench
