// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/job_request.h"

#include <algorithm>
#include <cstdint>

#include <fmt/format.h>

#include "services/rendering/film_camera.h"
#include "services/simulation/effect.h"

namespace vorocast::server {
namespace {

constexpr std::size_t kEffectBytesMax = 1 << 20;
constexpr std::size_t kUserMax = 100;
constexpr std::int32_t kCellsMax = 200'000;
constexpr std::int32_t kWindowMax = 1'000;
constexpr std::int32_t kPriorityMax = 1'000'000;
constexpr std::int32_t kFrameNumberMax = 10'000'000;

absl::Status CheckRange(std::int32_t value, std::int32_t low, std::int32_t high, std::string_view field) {
  if (value >= low && value <= high) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format("{} is {}; it must be from {} to {}", field, value, low, high));
}

constexpr std::int32_t kWorkersMax = 1'000'000;
constexpr std::int64_t kMemoryMin = std::int64_t{64} << 20;
constexpr std::int64_t kMemoryMax = std::int64_t{4} << 40;
constexpr double kTimeFactorMin = 0.1;
constexpr double kTimeFactorMax = 100;
/// The year 9999: nobody means more, and no clock arithmetic overflows before.
constexpr double kDeadlineMax = 253'402'300'799.0;

absl::Status CheckMemory(std::int64_t bytes) {
  if (bytes == 0 || (bytes >= kMemoryMin && bytes <= kMemoryMax)) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("memory_limit is {} bytes; it must be from {} MiB to {} TiB", bytes, kMemoryMin >> 20, kMemoryMax >> 40));
}

absl::Status CheckTimeFactor(double factor) {
  if (factor == 0 || (factor >= kTimeFactorMin && factor <= kTimeFactorMax)) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format("time_factor is {}; it must be from {} to {}", factor, kTimeFactorMin, kTimeFactorMax));
}

/// They would reach other people's terminals and the log.
bool HasControlCharacters(const std::string& text) {
  return std::ranges::any_of(text, [](unsigned char c) { return c < 0x20 || c == 0x7f; });
}

absl::StatusOr<nlohmann::json> EffectOf(const std::string& text) {
  if (text.empty()) return nlohmann::json();
  if (text.size() > kEffectBytesMax)
    return absl::InvalidArgumentError(fmt::format("effect_json has {} bytes; at most {} are taken", text.size(), kEffectBytesMax));
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (json.is_discarded()) return absl::InvalidArgumentError("effect_json is not JSON");
  auto effect = simulation::NormaliseEffect(json);
  if (!effect.ok()) return base::Annotate(effect.status(), "effect_json");
  if (HasControlCharacters(effect->at("name").get<std::string>())) return absl::InvalidArgumentError("effect_json: name has control characters");
  return effect;
}

absl::StatusOr<tasks::FilmOptions> FilmOf(const v1::Film& film) {
  tasks::FilmOptions options;
  if (film.width() != 0) options.width = film.width();
  if (film.height() != 0) options.height = film.height();
  if (film.samples() != 0) options.samples = film.samples();
  if (!(film.shutter() < 0)) options.shutter = film.shutter();
  if (!film.colour().empty()) options.colour = film.colour();
  if (film.camera_json().size() > kEffectBytesMax) {
    return absl::InvalidArgumentError(
        fmt::format("film: camera_json has {} bytes; at most {} are taken", film.camera_json().size(), kEffectBytesMax));
  }
  if (!film.camera_json().empty()) {
    options.camera = nlohmann::json::parse(film.camera_json(), nullptr, false);
    if (options.camera.is_discarded()) return absl::InvalidArgumentError("film: camera_json is not JSON");
    if (const auto path = rendering::CameraPathFromJson(options.camera); !path.ok()) return base::Annotate(path.status(), "film");
  }
  // The tasks' own checks know the limits.
  tasks::FilmOptions checked;
  if (const absl::Status status = tasks::FromJson(tasks::ToJson(options), checked); !status.ok()) return base::Annotate(status, "film");
  return checked;
}

}  // namespace

absl::StatusOr<plan::JobSpec> SpecOf(const v1::SubmitJobRequest& request) {
  plan::JobSpec spec;
  if (HasControlCharacters(request.user())) return absl::InvalidArgumentError("user has control characters");
  if (request.user().size() > kUserMax) return absl::InvalidArgumentError(fmt::format("user has more than {} characters", kUserMax));
  RETURN_IF_ERROR(CheckRange(request.cells(), 0, kCellsMax, "cells"));
  RETURN_IF_ERROR(CheckRange(request.iterations(), INT32_MIN, 1000, "iterations"));
  RETURN_IF_ERROR(CheckRange(request.template_frame(), INT32_MIN, kFrameNumberMax, "template_frame"));
  RETURN_IF_ERROR(CheckRange(request.window_frames(), 0, kWindowMax, "window_frames"));
  RETURN_IF_ERROR(CheckRange(request.interpolated_max(), INT32_MIN, kFrameNumberMax, "interpolated_max"));
  RETURN_IF_ERROR(CheckRange(request.priority(), -kPriorityMax, kPriorityMax, "priority"));
  if (request.cells() > 0) spec.tessellate.cells = request.cells();
  if (request.iterations() >= 0) spec.tessellate.iterations = request.iterations();
  if (!request.indicator().empty()) spec.tessellate.indicator = request.indicator();
  if (!request.start().empty()) spec.tessellate.start = request.start();
  RETURN_IF_ERROR(CheckRange(request.patches(), 0, spec.tessellate.cells, "patches"));
  spec.patches = request.patches() > 0 ? request.patches() : std::clamp(spec.tessellate.cells / 25, 1, 200);
  spec.template_frame = std::max(request.template_frame(), -1);
  if (request.window_frames() > 0) spec.window_frames = request.window_frames();
  spec.overlap_frames = std::min(spec.overlap_frames, spec.window_frames - 1);
  spec.interpolated_max = std::max(request.interpolated_max(), -1);
  spec.sheets = request.sheets();
  if (request.has_film()) {
    ASSIGN_OR_RETURN(spec.film, FilmOf(request.film()));
  }
  ASSIGN_OR_RETURN(spec.effect, EffectOf(request.effect_json()));
  RETURN_IF_ERROR(simulation::CheckSecondTake(spec.effect, !request.onto_sequence_id().empty()));
  // The tasks' own checks know the choices.
  tasks::TessellateOptions checked;
  RETURN_IF_ERROR(tasks::FromJson(tasks::ToJson(spec.tessellate), checked));
  return spec;
}

absl::StatusOr<core::JobTerms> TermsOf(const v1::SubmitJobRequest& request) {
  RETURN_IF_ERROR(CheckRange(request.workers_max(), 0, kWorkersMax, "workers_max"));
  RETURN_IF_ERROR(CheckMemory(request.memory_limit()));
  RETURN_IF_ERROR(CheckTimeFactor(request.time_factor()));
  if (!(request.deadline() >= 0 && request.deadline() <= kDeadlineMax))
    return absl::InvalidArgumentError(fmt::format("deadline is {}; it must be seconds since 1970", request.deadline()));
  return core::JobTerms{.workers_max = request.workers_max(),
                        .deadline = request.deadline(),
                        .memory_limit = request.memory_limit(),
                        .time_factor = request.time_factor() == 0 ? 1 : request.time_factor()};
}

absl::Status SetLimits(const v1::RetryJobRequest& request, core::JobTerms& terms) {
  RETURN_IF_ERROR(CheckMemory(request.memory_limit()));
  RETURN_IF_ERROR(CheckTimeFactor(request.time_factor()));
  if (request.memory_limit() != 0) terms.memory_limit = request.memory_limit();
  if (request.time_factor() != 0) terms.time_factor = request.time_factor();
  return absl::OkStatus();
}

void SetCapture(const store::SequenceOpened& sequence, plan::JobSpec& spec) {
  spec.tessellate.capture = {.metres_per_unit = sequence.metres_per_unit, .up = sequence.up};
  spec.frames_per_second = sequence.frames_per_second;
}

void SetOnto(const store::SequenceOpened& sequence, plan::JobSpec& spec) {
  spec.onto = {.sequence = sequence.id,
               .capture = {.metres_per_unit = sequence.metres_per_unit, .up = sequence.up},
               .frames_per_second = sequence.frames_per_second};
}

}  // namespace vorocast::server
