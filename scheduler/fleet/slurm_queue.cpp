// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/fleet/slurm_queue.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <tuple>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace vorocast::fleet {
namespace {

using nlohmann::json;

constexpr std::size_t kTasksMax = 100'000;
constexpr std::int64_t kNumberMax = 1'000'000'000'000;

const json* Field(const json& object, const char* name) {
  const auto field = object.find(name);
  return field == object.end() ? nullptr : &*field;
}

/// 22.05 writes 7 or null, later versions {"set": true, "infinite": false, "number": 7}.
std::optional<std::int64_t> Number(const json* value) {
  if (!value) return std::nullopt;
  if (value->is_number_integer()) return value->get<std::int64_t>();
  if (!value->is_object()) return std::nullopt;
  const json* set = Field(*value, "set");
  if (!set || !set->is_boolean() || !set->get<bool>()) return std::nullopt;
  const json* number = Field(*value, "number");
  return number && number->is_number_integer() ? std::optional(number->get<std::int64_t>()) : std::nullopt;
}

std::string Text(const json* value) { return value && value->is_string() ? value->get<std::string>() : std::string(); }

/// 22.05 writes "RUNNING", later versions ["RUNNING", "COMPLETING"].
std::optional<SlurmMember::State> StateIn(const json* value) {
  std::vector<std::string> words;
  if (value && value->is_array()) {
    for (const json& word : *value) words.push_back(Text(&word));
  } else {
    words.push_back(Text(value));
  }
  const auto has = [&](std::string_view word) { return std::find(words.begin(), words.end(), word) != words.end(); };
  if (has("COMPLETING") || has("STAGE_OUT")) return SlurmMember::State::kEnding;
  if (has("RUNNING") || has("CONFIGURING") || has("SUSPENDED") || has("STOPPED") || has("SIGNALING")) return SlurmMember::State::kUp;
  if (has("PENDING") || has("REQUEUED") || has("REQUEUE_HOLD") || has("REQUEUE_FED") || has("RESIZING")) return SlurmMember::State::kQueued;
  return std::nullopt;
}

std::optional<std::int64_t> WholeNumber(std::string_view text) {
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number < 0 || number > kNumberMax) return std::nullopt;
  return number;
}

void ReadJob(const json& job, std::string_view job_name, std::vector<SlurmMember>& members) {
  if (!job.is_object() || Text(Field(job, "name")) != job_name) return;
  const auto state = StateIn(Field(job, "job_state"));
  const auto array = Number(Field(job, "array_job_id"));
  if (!state || !array || *array <= 0) return;
  // Elements that have not started share one entry, which lists them as text.
  const std::string listed = Text(Field(job, "array_task_string"));
  if (!listed.empty()) {
    for (const std::int64_t task : ParseTaskRanges(listed, kTasksMax)) members.push_back({*array, task, *state});
  } else if (const auto task = Number(Field(job, "array_task_id")); task && *task >= 0) {
    members.push_back({*array, *task, *state});
  }
}

}  // namespace

std::string Name(const SlurmMember& member) { return fmt::format("{}_{}", member.job, member.task); }

std::vector<std::int64_t> ParseTaskRanges(std::string_view text, std::size_t count_max) {
  std::vector<std::int64_t> tasks;
  text = text.substr(0, text.find('%'));
  while (!text.empty()) {
    const std::size_t comma = text.find(',');
    std::string_view range = text.substr(0, comma);
    text = comma == std::string_view::npos ? std::string_view() : text.substr(comma + 1);
    std::int64_t step = 1;
    if (const std::size_t colon = range.find(':'); colon != std::string_view::npos) {
      step = WholeNumber(range.substr(colon + 1)).value_or(0);
      range = range.substr(0, colon);
    }
    const std::size_t dash = range.find('-');
    const auto first = WholeNumber(range.substr(0, dash));
    const auto last = dash == std::string_view::npos ? first : WholeNumber(range.substr(dash + 1));
    if (!first || !last || step < 1) continue;
    for (std::int64_t task = *first; task <= *last && tasks.size() < count_max; task += step) tasks.push_back(task);
  }
  return tasks;
}

absl::StatusOr<std::vector<SlurmMember>> ParseQueue(std::string_view text, std::string_view job_name) {
  const json document = json::parse(text, nullptr, false);
  if (document.is_discarded() || !document.is_object()) return absl::DataLossError("squeue --json printed something else than JSON");
  const json* jobs = Field(document, "jobs");
  if (!jobs || !jobs->is_array()) return absl::DataLossError("squeue --json printed no list of jobs");
  std::vector<SlurmMember> members;
  for (const json& job : *jobs) ReadJob(job, job_name, members);
  std::sort(members.begin(), members.end(),
            [](const SlurmMember& a, const SlurmMember& b) { return std::tie(a.job, a.task) < std::tie(b.job, b.task); });
  return members;
}

absl::StatusOr<std::int64_t> ParseSubmitted(std::string_view text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.remove_suffix(1);
  const auto job = WholeNumber(text.substr(0, text.find(';')));
  if (!job || *job == 0) return absl::DataLossError("sbatch printed no job number");
  return *job;
}

}  // namespace vorocast::fleet
