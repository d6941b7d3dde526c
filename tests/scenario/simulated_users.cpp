// SPDX-License-Identifier: AGPL-3.0-or-later
// What users do: they submit, cancel, retry under other limits, pause and resume.
#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tests/scenario/simulated_farm.h"

namespace vorocast::scenario {

core::JobSubmitted SimulatedFarm::Submission(const SimulatedStore::SubmittedJob& job) {
  core::JobSubmitted submitted{
      .id = job.id, .name = "take", .user = job.user, .priority = job.priority, .terms = job.terms, .paused = job.paused, .cancelled = job.cancelled};
  for (const auto& [task, failure] : job.failures) submitted.failures.push_back(failure);
  return submitted;
}

void SimulatedFarm::SubmitJobs() {
  const std::uint64_t count = 1 + random_.Below(3);
  for (std::uint64_t i = 0; i < count; ++i) {
    plan::JobSpec spec;
    spec.window_frames = 4;
    spec.overlap_frames = 1;
    spec.patches = 10;
    spec.interpolated_max = static_cast<std::int32_t>(random_.Below(4)) - 1;
    spec.template_frame = Chance(0.5) ? 0 : -1;
    spec.sheets = Chance(0.5);
    spec.effect = Chance(0.5) ? nlohmann::json{{"name", "pendulum"}, {"strength", static_cast<std::int32_t>(random_.Below(2))}} : nlohmann::json();
    memory_.jobs.push_back({.id = fmt::format("j{}", memory_.jobs.size() + 1),
                            .user = Chance(0.5) ? "anna" : "bert",
                            .priority = static_cast<std::int32_t>(random_.Below(2)),
                            .spec = std::move(spec),
                            .terms = {.workers_max = Chance(0.3) ? 1 + static_cast<std::int32_t>(random_.Below(3)) : 0,
                                      .deadline = Chance(0.3) ? 1e9 + static_cast<double>(random_.Below(100)) : 0}});
  }
}

absl::Status SimulatedFarm::ActAsUser() {
  const std::string job = memory_.jobs[random_.Below(memory_.jobs.size())].id;
  switch (random_.Below(5)) {
    case 0:
      return Happen(core::CancelJob{job});
    case 1:
      return Happen(core::RetryJob{.job = job,
                                   .memory_limit = Chance(0.5) ? std::int64_t{1} << (30 + random_.Below(5)) : 0,
                                   .time_factor = Chance(0.5) ? 0.5 * static_cast<double>(1 + random_.Below(6)) : 0});
    case 2:
    case 3:
      return Happen(core::PauseJob{job, Chance(0.6)});
    default: {
      const std::size_t before = memory_.jobs.size();
      if (before > 5) return absl::OkStatus();
      SubmitJobs();
      for (std::size_t i = before; i < memory_.jobs.size(); ++i) {
        const SimulatedStore::SubmittedJob added = memory_.jobs[i];
        RETURN_IF_ERROR(Happen(Submission(added)));
        RETURN_IF_ERROR(Plan(added));
      }
      return absl::OkStatus();
    }
  }
}

absl::Status SimulatedFarm::ResumeAll() {
  for (std::size_t i = 0; i < memory_.jobs.size(); ++i) RETURN_IF_ERROR(Happen(core::PauseJob{memory_.jobs[i].id, false}));
  return absl::OkStatus();
}

}  // namespace vorocast::scenario
