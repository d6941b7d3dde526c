// SPDX-License-Identifier: AGPL-3.0-or-later
#include <string>

#include <fmt/format.h>

#include "scheduler/plan/plan.h"

namespace vorocast::plan {
namespace {

template <typename T>
absl::Status Read(const nlohmann::json& json, const char* name, T& value) {
  const auto field = json.find(name);
  if (field == json.end()) return absl::OkStatus();  // recorded before there was such a field
  try {
    field->get_to(value);
  } catch (const nlohmann::json::exception&) {
    return absl::InvalidArgumentError(fmt::format("job.{} has the wrong type", name));
  }
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
  RETURN_IF_ERROR(Read(json, "sequence", onto.sequence));
  RETURN_IF_ERROR(Read(json, "metres_per_unit", onto.capture.metres_per_unit));
  RETURN_IF_ERROR(Read(json, "up", onto.capture.up));
  RETURN_IF_ERROR(Read(json, "frames_per_second", onto.frames_per_second));
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
  RETURN_IF_ERROR(Read(json, "template_frame", job.template_frame));
  RETURN_IF_ERROR(Read(json, "patches", job.patches));
  RETURN_IF_ERROR(Read(json, "window_frames", job.window_frames));
  RETURN_IF_ERROR(Read(json, "overlap_frames", job.overlap_frames));
  RETURN_IF_ERROR(Read(json, "stretch_frames", job.stretch_frames));
  RETURN_IF_ERROR(Read(json, "interpolated_max", job.interpolated_max));
  RETURN_IF_ERROR(Read(json, "frames_per_second", job.frames_per_second));
  RETURN_IF_ERROR(ReadOptions(json, "track", job.track));
  RETURN_IF_ERROR(Read(json, "effect", job.effect));
  RETURN_IF_ERROR(Read(json, "sheets", job.sheets));
  if (const auto film = json.find("film"); film != json.end() && !film->is_null()) RETURN_IF_ERROR(ReadOptions(json, "film", job.film.emplace()));
  if (const auto onto = json.find("onto"); onto != json.end() && !onto->is_null()) {
    ASSIGN_OR_RETURN(job.onto, OntoFromJson(*onto));
  }
  return job;
}

}  // namespace vorocast::plan
