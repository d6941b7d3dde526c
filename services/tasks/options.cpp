// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/tasks/options.h"

#include <limits>

#include <fmt/format.h>
#include "services/tasks/field_table.h"

namespace vorocast::tasks {
namespace {

constexpr std::int32_t kCellsMax = 200'000;

}  // namespace

// Each options struct once: its fields' names in JSON and what they may hold. Not in an unnamed namespace, so that the tables find them.

template <typename Table>
static void Describe(Table& table, CaptureFrameOptions& options) {
  table.Number("metres_per_unit", options.metres_per_unit, 1e-6, 1e3);
  table.Choice("up", options.up, {"+x", "-x", "+y", "-y", "+z", "-z"});
}

template <typename Table>
static void Describe(Table& table, TessellateOptions& options) {
  table.Nested("capture", options.capture);
  table.Integer("cells", options.cells, 1, kCellsMax);
  table.Integer("iterations", options.iterations, 0, 1000);
  table.Choice("start", options.start, {"lattice", "random"});
  table.Choice("indicator", options.indicator, {"spectral", "cgal"});
  table.Integer("seed", options.seed, std::uint64_t{0}, std::numeric_limits<std::uint64_t>::max());
}

template <typename Table>
static void Describe(Table& table, TemplateOptions& options) {
  table.Nested("tessellate", options.tessellate);
  table.Integer("frame", options.frame, -1, kFrameNumberMax);
  table.Integer("patches", options.patches, 1, kCellsMax);
}

template <typename Table>
static void Describe(Table& table, StretchOptions& options) {
  table.Integer("points", options.points, 100, 1'000'000);
  table.Integer("iterations", options.iterations, 1, 1000);
  table.Integer("patches", options.patches, 1, kCellsMax);
}

template <typename Table>
static void Describe(Table& table, GuideOptions& options) {
  table.Integer("points", options.points, 100, 1'000'000);
  table.Integer("iterations", options.iterations, 1, 1000);
}

template <typename Table>
static void Describe(Table& table, TrackOptions& options) {
  table.Integer("iterations", options.iterations, 1, 1000);
  table.Number("regulariser", options.regulariser, 1e-6, 1e6);
  table.Number("sigma_start_m", options.sigma_start_m, 1e-5, 10);
  table.Number("sigma_end_m", options.sigma_end_m, 1e-5, 10);
  table.Number("normal_angle_max_deg", options.normal_angle_max_deg, 0, 180);
  table.Number("depth_tolerance_m", options.depth_tolerance_m, 0, 10);
  table.Frames("frames", options.frames);
}

template <typename Table>
static void Describe(Table& table, AssembleOptions& options) {
  table.Number("frames_per_second", options.frames_per_second, 1, 1000);
  table.Frames("frames", options.frames);
  table.Integer("interpolated_max", options.interpolated_max, 0, kFrameNumberMax);
}

template <typename Table>
static void Describe(Table& table, SimulateOptions& options) {
  table.Object("effect", options.effect);
}

template <typename Table>
static void Describe(Table& table, SheetOptions& options) {
  table.Choice("stage", options.stage, {"points", "cells", "tracked", "simulated"});
  table.Integer("pictures", options.pictures, 1, 100);
  table.Integer("width", options.width, 16, 4096);
  table.Nested("capture", options.capture);
}

template <typename Table>
static void Describe(Table& table, FilmOptions& options) {
  table.Integer("width", options.width, 16, 16384);
  table.Integer("height", options.height, 16, 16384);
  table.Integer("samples", options.samples, 1, 64);
  table.Number("shutter", options.shutter, 0, 1);
  table.Choice("colour", options.colour, {"capture", "patch"});
  table.Object("camera", options.camera);
}

template <typename Table>
static void Describe(Table& table, RenderOptions& options) {
  table.Nested("film", options.film);
  table.Integer("instant", options.instant, 0, kFrameNumberMax);
}

template <typename Table>
static void Describe(Table& table, EncodeOptions& options) {
  table.Number("frames_per_second", options.frames_per_second, 1, 1000);
}

namespace {

template <typename Options>
nlohmann::json Write(Options options) {
  FieldWriter writer;
  Describe(writer, options);
  return writer.json();
}

/// Leaves `target` untouched unless the whole of `json` is right.
template <typename Options>
absl::Status Read(const nlohmann::json& json, Options& target) {
  Options options;
  FieldReader reader(json, "options.");
  Describe(reader, options);
  RETURN_IF_ERROR(reader.Finish());
  target = std::move(options);
  return absl::OkStatus();
}

}  // namespace

nlohmann::json ToJson(const TessellateOptions& options) { return Write(options); }
nlohmann::json ToJson(const TemplateOptions& options) { return Write(options); }
nlohmann::json ToJson(const StretchOptions& options) { return Write(options); }
nlohmann::json ToJson(const GuideOptions& options) { return Write(options); }
nlohmann::json ToJson(const TrackOptions& options) { return Write(options); }
nlohmann::json ToJson(const AssembleOptions& options) { return Write(options); }
nlohmann::json ToJson(const SimulateOptions& options) { return Write(options); }
nlohmann::json ToJson(const SheetOptions& options) { return Write(options); }
nlohmann::json ToJson(const FilmOptions& options) { return Write(options); }
nlohmann::json ToJson(const RenderOptions& options) { return Write(options); }
nlohmann::json ToJson(const EncodeOptions& options) { return Write(options); }

absl::Status FromJson(const nlohmann::json& json, TessellateOptions& options) { return Read(json, options); }

absl::Status FromJson(const nlohmann::json& json, TemplateOptions& target) {
  TemplateOptions options;
  RETURN_IF_ERROR(Read(json, options));
  if (options.patches > options.tessellate.cells) {
    return absl::InvalidArgumentError(
        fmt::format("options.patches is {}; it must be at most the number of cells, {}", options.patches, options.tessellate.cells));
  }
  target = std::move(options);
  return absl::OkStatus();
}

absl::Status FromJson(const nlohmann::json& json, StretchOptions& options) { return Read(json, options); }
absl::Status FromJson(const nlohmann::json& json, GuideOptions& options) { return Read(json, options); }

absl::Status FromJson(const nlohmann::json& json, TrackOptions& target) {
  TrackOptions options;
  RETURN_IF_ERROR(Read(json, options));
  if (options.sigma_end_m > options.sigma_start_m) {
    return absl::InvalidArgumentError(
        fmt::format("options.sigma_end_m is {}; it must be at most sigma_start_m, {}", options.sigma_end_m, options.sigma_start_m));
  }
  target = std::move(options);
  return absl::OkStatus();
}

absl::Status FromJson(const nlohmann::json& json, AssembleOptions& options) { return Read(json, options); }
absl::Status FromJson(const nlohmann::json& json, SimulateOptions& options) { return Read(json, options); }
absl::Status FromJson(const nlohmann::json& json, SheetOptions& options) { return Read(json, options); }
absl::Status FromJson(const nlohmann::json& json, FilmOptions& options) { return Read(json, options); }
absl::Status FromJson(const nlohmann::json& json, RenderOptions& options) { return Read(json, options); }
absl::Status FromJson(const nlohmann::json& json, EncodeOptions& options) { return Read(json, options); }

}  // namespace vorocast::tasks
