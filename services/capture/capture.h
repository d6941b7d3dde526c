// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "services/base/status.h"

/// A capture is a folder with one file a frame (PLY, OBJ, OFF, Draco), in natural numeric order, and optionally a capture.json.
namespace vorocast::capture {

/// What a capture's numbers mean. From flags first, then capture.json, then these defaults.
struct CaptureOptions {
  std::optional<std::string> name;
  std::optional<double> frames_per_second;  // 25
  std::optional<std::string> unit;          // "m", "cm", "mm", "in", "ft"
  std::optional<std::string> up;            // "+y", "-y", "+z", … ("y" means "+y")
  std::optional<std::int32_t> components;   // how many bodies to expect, for a warning only
  std::int32_t first = 0;                   // frames [first, last) by position in the folder, as in --frames 0:60
  std::optional<std::int32_t> last;
};

struct CaptureFrame {
  std::int32_t number = 0;  // 0-based position in the folder's natural order
  std::filesystem::path path;
};

struct Capture {
  std::string name;
  double frames_per_second = 25;
  double metres_per_unit = 1;
  std::string up = "+y";
  std::int32_t components = 0;  // 0: unknown
  std::vector<CaptureFrame> frames;
};

/// Lists a folder and reads its capture.json. Opens no frame. INVALID_ARGUMENT or NOT_FOUND say what to do.
absl::StatusOr<Capture> OpenCapture(const std::filesystem::path& folder, const CaptureOptions& options);

/// "cm" -> 0.01. INVALID_ARGUMENT lists the units.
absl::StatusOr<double> MetresPerUnit(const std::string& unit);

}  // namespace vorocast::capture
