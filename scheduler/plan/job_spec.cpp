// SPDX-License-Identifier: AGPL-3.0-or-later
#include <string>

#include <fmt/format.h>

#include "scheduler/plan/plan.h"
#include "services/tasks/field_table.h"

namespace vorocast::plan {
namespace {

/// As deep as an effect's options may nest: copying a value recurses.
constexpr int kEffectDepthMax = 32;

absl::Status ReadWhole(const nlohmann::json& json, const char* name, std::int32_t low, std::int32_t& value) {
  const auto field = json.find(name);
  if (field == json.end()) return absl::OkStatus();  // recorded before there was such a field
  if (!tasks::IsWholeIn(*field, low, tasks::kFrameNumberMax)) {
    return absl::InvalidArgumentError(fmt::format("job.{} must be a whole number from {} to {}", name, low, tasks::kFrameNumberMax));
  }
  value = field->get<std::int32_t>();
  return absl::OkStatus();
}

absl::Status ReadRate(const nlohmann::json& json, double& value) {
  const auto field = json.find("frames_per_second");
  if (field == json.end()) return absl::OkStatus();
  if (!field->is_number() || !(field->get<double>() > 0 && field->get<double>() <= 1000)) {
    return absl::InvalidArgumentError("job.frames_per_second must be a number above 0, up to 1000");
  }
  value = field->get<double>();
  return absl::OkStatus();
}

template <typename Options>
absl::Status ReadOptions(const nlohmann::json& json, const char* name, Options& options) {
  const auto field = json.find(name);
  if (field == json.end()) return absl::OkStatus();  // recorded before there was such a field
  return base::Annotate(tasks::FromJson(*field, options), fmt::format("job.{}", name));
}

absl::StatusOr<OntoTake> OntoFromJson(const nlohmann::json& json) {
  if (!json.is_object()) return absl::InvalidArgumentError("job.onto is not an object");
  OntoTake onto;
  if (const auto sequence = json.find("sequence"); sequence != json.end()) {
    if (!sequence->is_string()) return absl::InvalidArgumentError("job.onto.sequence is not a text");
    onto.sequence = sequence->get<std::string>();
  }
  // The tasks' own checks know the limits.
  nlohmann::json capture = nlohmann::json::object();
  for (const char* field : {"metres_per_unit", "up"}) {
    if (const auto found = json.find(field); found != json.end() && found->is_primitive()) capture[field] = *found;
  }
  tasks::TessellateOptions checked;
  RETURN_IF_ERROR(base::Annotate(tasks::FromJson(nlohmann::json{{"capture", capture}}, checked), "job.onto"));
  onto.capture = checked.capture;
  RETURN_IF_ERROR(ReadRate(json, onto.frames_per_second));
  return onto;
}

nlohmann::json OntoJson(const OntoTake& onto) {
  return {{"sequence", onto.sequence},
          {"metres_per_unit", onto.capture.metres_per_unit},
          {"up", onto.capture.up},
          {"frames_per_second", onto.frames_per_second}};
}

}  // namespace

nlohmann::json ToJson(const JobSpec& job) {
  return {{"tessellate", tasks::ToJson(job.tessellate)},
          {"template_frame", job.template_frame},
          {"patches", job.patches},
          {"window_frames", job.window_frames},
          {"overlap_frames", job.overlap_frames},
          {"stretch_frames", job.stretch_frames},
          {"interpolated_max", job.interpolated_max},
          {"frames_per_second", job.frames_per_second},
          {"track", tasks::ToJson(job.track)},
          {"effect", job.effect},
          {"sheets", job.sheets},
          {"film", job.film ? tasks::ToJson(*job.film) : nlohmann::json()},
          {"onto", job.onto ? OntoJson(*job.onto) : nlohmann::json()}};
}

absl::StatusOr<JobSpec> JobSpecFromJson(const nlohmann::json& json) {
  if (!json.is_object()) return absl::InvalidArgumentError("job is not an object");
  JobSpec job;
  RETURN_IF_ERROR(ReadOptions(json, "tessellate", job.tessellate));
  RETURN_IF_ERROR(ReadWhole(json, "template_frame", -1, job.template_frame));
  RETURN_IF_ERROR(ReadWhole(json, "patches", 1, job.patches));
  RETURN_IF_ERROR(ReadWhole(json, "window_frames", 1, job.window_frames));
  RETURN_IF_ERROR(ReadWhole(json, "overlap_frames", 0, job.overlap_frames));
  RETURN_IF_ERROR(ReadWhole(json, "stretch_frames", 1, job.stretch_frames));
  RETURN_IF_ERROR(ReadWhole(json, "interpolated_max", -1, job.interpolated_max));
  if (job.overlap_frames >= job.window_frames) return absl::InvalidArgumentError("job.overlap_frames must be less than job.window_frames");
  RETURN_IF_ERROR(ReadRate(json, job.frames_per_second));
  RETURN_IF_ERROR(ReadOptions(json, "track", job.track));
  if (const auto effect = json.find("effect"); effect != json.end() && !effect->is_null()) {
    if (!effect->is_object() || !tasks::NestsWithin(*effect, kEffectDepthMax)) {
      return absl::InvalidArgumentError(fmt::format("job.effect must be null, or an object that nests at most {} deep", kEffectDepthMax));
    }
    job.effect = *effect;
  }
  if (const auto sheets = json.find("sheets"); sheets != json.end()) {
    if (!sheets->is_boolean()) return absl::InvalidArgumentError("job.sheets must be true or false");
    job.sheets = sheets->get<bool>();
  }
  if (const auto film = json.find("film"); film != json.end() && !film->is_null()) RETURN_IF_ERROR(ReadOptions(json, "film", job.film.emplace()));
  if (const auto onto = json.find("onto"); onto != json.end() && !onto->is_null()) {
    ASSIGN_OR_RETURN(job.onto, OntoFromJson(*onto));
  }
  return job;
}

}  // namespace vorocast::plan
