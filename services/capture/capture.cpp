// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <system_error>

#include "services/capture/file_bytes.h"
#include "services/capture/frame_reader.h"
#include "services/capture/natural_order.h"
#include "services/capture/units.h"

namespace vorocast::capture {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kDescriptionMax = 1 << 20;
constexpr double kFramesPerSecondMax = 1000;

std::string Lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return text;
}

absl::Status ReadField(const std::string& field, const nlohmann::json& value, CaptureOptions& options) {
  const auto wrong = [&](std::string_view expected) { return absl::InvalidArgumentError(fmt::format("\"{}\" should be {}", field, expected)); };
  if (field == "name") {
    if (!value.is_string()) return wrong("a string");
    options.name = value.get<std::string>();
  } else if (field == "frames_per_second") {
    if (!value.is_number()) return wrong("a number");
    options.frames_per_second = value.get<double>();
  } else if (field == "unit") {
    if (!value.is_string()) return wrong("\"m\", \"cm\", \"mm\", \"in\" or \"ft\"");
    options.unit = value.get<std::string>();
  } else if (field == "up") {
    if (!value.is_string()) return wrong("\"+x\", \"-x\", \"+y\", \"-y\", \"+z\" or \"-z\"");
    options.up = value.get<std::string>();
  } else if (field == "components") {
    if (!value.is_number_integer() || value < 0 || value > 1000) return wrong("a whole number from 0 to 1000");
    options.components = value.get<std::int32_t>();
  } else {
    return absl::InvalidArgumentError(fmt::format("the field \"{}\" is unknown: known are name, frames_per_second, unit, up and components", field));
  }
  return absl::OkStatus();
}

absl::StatusOr<CaptureOptions> ParseDescription(const std::string& text) {
  nlohmann::json json;
  try {
    json = nlohmann::json::parse(text);
  } catch (const nlohmann::json::exception& error) {
    return absl::InvalidArgumentError(fmt::format("is no JSON: {}", error.what()));
  }
  if (!json.is_object()) return absl::InvalidArgumentError("should be a JSON object, as in {\"unit\": \"cm\", \"up\": \"-y\"}");
  CaptureOptions options;
  for (const auto& [field, value] : json.items()) RETURN_IF_ERROR(ReadField(field, value, options));
  return options;
}

/// What capture.json says, or nothing where there is none.
absl::StatusOr<CaptureOptions> ReadDescription(const fs::path& folder) {
  const fs::path path = folder / "capture.json";
  std::error_code error;
  if (!fs::exists(path, error)) return CaptureOptions{};
  auto text = ReadFileBytes(path, kDescriptionMax);
  if (!text.ok()) return base::Annotate(text.status(), path.string());
  auto options = ParseDescription(*text);
  if (!options.ok()) return base::Annotate(options.status(), path.string());
  return options;
}

/// Flags win over the file, the file over the defaults.
absl::Status Settle(const CaptureOptions& flags, const CaptureOptions& file, Capture& capture) {
  const auto settle = [](auto& target, const auto& flag, const auto& written) {
    if (flag) {
      target = *flag;
    } else if (written) {
      target = *written;
    }
  };
  std::string unit = "m";
  settle(unit, flags.unit, file.unit);
  settle(capture.name, flags.name, file.name);
  settle(capture.frames_per_second, flags.frames_per_second, file.frames_per_second);
  settle(capture.up, flags.up, file.up);
  settle(capture.components, flags.components, file.components);
  ASSIGN_OR_RETURN(capture.metres_per_unit, MetresPerUnit(unit));
  ASSIGN_OR_RETURN(capture.up, NormaliseUp(capture.up));
  if (!(capture.frames_per_second > 0 && capture.frames_per_second <= kFramesPerSecondMax)) {
    return absl::InvalidArgumentError(
        fmt::format("{} frames per second: give more than 0 and at most {}", capture.frames_per_second, kFramesPerSecondMax));
  }
  if (capture.name.empty()) return absl::InvalidArgumentError("the capture's name is empty: give one with --name");
  if (capture.components < 0) return absl::InvalidArgumentError(fmt::format("{} components: give 0 (unknown) or more", capture.components));
  return absl::OkStatus();
}

/// The frames' paths in natural order. One format a folder: two of them would put one instant twice in the take.
absl::StatusOr<std::vector<fs::path>> ListFrames(const fs::path& folder) {
  std::vector<fs::path> paths;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.starts_with('.') || !IsFrameExtension(Lower(entry->path().extension().string()))) continue;
    std::error_code ignored;
    if (entry->is_regular_file(ignored)) paths.push_back(entry->path());
  }
  if (error) return absl::UnavailableError(fmt::format("cannot be listed: {}", error.message()));
  if (paths.empty()) return absl::NotFoundError("holds no frames: a frame is a .ply, .obj, .off or .drc file, one file for each captured instant");
  std::ranges::sort(paths, [](const fs::path& a, const fs::path& b) { return NaturalLess(a.filename().string(), b.filename().string()); });
  const auto kind = [](const fs::path& path) { return Lower(path.extension().string()); };
  const auto other = std::ranges::find_if(paths, [&](const fs::path& path) { return kind(path) != kind(paths[0]); });
  if (other != paths.end()) {
    return absl::InvalidArgumentError(fmt::format("holds frames of two formats, {} and {}: keep one format in the folder and move the other away",
                                                  paths[0].filename().string(), other->filename().string()));
  }
  return paths;
}

std::string FolderName(const fs::path& folder) {
  std::error_code error;
  const fs::path whole = fs::weakly_canonical(folder, error);
  return error ? folder.filename().string() : whole.filename().string();
}

}  // namespace

absl::StatusOr<Capture> OpenCapture(const fs::path& folder, const CaptureOptions& options) {
  std::error_code error;
  if (!fs::exists(folder, error)) return absl::NotFoundError(fmt::format("{}: there is no such folder: check the path", folder.string()));
  if (!fs::is_directory(folder, error)) {
    return absl::InvalidArgumentError(fmt::format("{}: is no folder: give the folder that holds the frames", folder.string()));
  }
  Capture capture;
  capture.name = FolderName(folder);
  ASSIGN_OR_RETURN(const CaptureOptions file, ReadDescription(folder));
  if (absl::Status status = Settle(options, file, capture); !status.ok()) return base::Annotate(status, folder.string());
  auto paths = ListFrames(folder);
  if (!paths.ok()) return base::Annotate(paths.status(), folder.string());

  const auto count = static_cast<std::int32_t>(paths->size());
  const std::int32_t last = std::min(options.last.value_or(count), count);
  if (options.first < 0 || options.first >= last) {
    return absl::InvalidArgumentError(fmt::format(
        "{}: frames {}:{} are none of its {}: frames are counted from 0 in the order of their file names, and the second number is not included",
        folder.string(), options.first, options.last ? fmt::format("{}", *options.last) : "", count));
  }
  for (std::int32_t number = options.first; number < last; ++number) {
    capture.frames.push_back({number, std::move((*paths)[static_cast<std::size_t>(number)])});
  }
  return capture;
}

}  // namespace vorocast::capture
