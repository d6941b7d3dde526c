// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/catalogue.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "services/base/status.h"

namespace vorocast::server {
namespace {

std::vector<plan::PlannedFrame> PlannedFrames(const std::vector<store::FrameAdded>& frames) {
  std::vector<plan::PlannedFrame> planned;
  planned.reserve(frames.size());
  for (const store::FrameAdded& frame : frames) planned.push_back({.number = frame.number, .blob = frame.blob, .extension = frame.extension});
  return planned;
}

std::vector<store::FrameAdded> AllFrames(const CatalogueSequence& sequence) {
  std::vector<store::FrameAdded> frames;
  for (const auto& [number, frame] : sequence.frames) frames.push_back(frame);
  return frames;
}

}  // namespace

void Catalogue::Plan(Turn& turn, const CatalogueJob& job, const CatalogueSequence& sequence, const std::vector<store::FrameAdded>& frames) const {
  core::TasksAdded added{.job = job.added.id};
  if (job.spec.interpolated_max >= 0) added.bad_frames_max = job.spec.interpolated_max;
  if (sequence.closed) {
    added.complete = true;
    added.bad_frames_max = plan::InterpolatedMax(job.spec, static_cast<std::int32_t>(sequence.frames.size()));
  }
  auto planned = plan::Plan(job.spec, PlannedFrames(frames), sequence.closed);
  if (planned.ok()) {
    added.tasks = *std::move(planned);
  } else {
    added.impossible = std::string(planned.status().message());
  }
  turn.Apply(std::move(added));
}

void Catalogue::PlanWhole(Turn& turn, const CatalogueJob& job, const CatalogueSequence& sequence) const {
  Plan(turn, job, sequence, AllFrames(sequence));
}

absl::Status Catalogue::Restore(Turn& turn, store::Snapshot snapshot) {
  turn.Apply(core::Restored{.runs = std::move(snapshot.runs), .attempt_next = snapshot.attempt_next});
  for (store::StoredSequence& stored : snapshot.sequences) {
    const std::string id = stored.opened.id;
    sequence_by_name_.emplace(std::pair(stored.opened.session, stored.opened.name), id);
    CatalogueSequence& sequence = sequences_[id];
    sequence.opened = std::move(stored.opened);
    sequence.closed = stored.closed;
    for (store::FrameAdded& frame : stored.frames) sequence.frames.emplace(frame.number, std::move(frame));
  }
  for (store::StoredJob& stored : snapshot.jobs) {
    const std::string id = stored.added.id;
    const auto sequence = sequences_.find(stored.added.sequence);
    if (sequence == sequences_.end())
      return absl::DataLossError(fmt::format("job {} belongs to sequence {}, which is not on record", id, stored.added.sequence));
    const auto json = nlohmann::json::parse(stored.added.spec_json, nullptr, false);
    auto spec = plan::JobSpecFromJson(json);
    if (!spec.ok()) {
      // One job that a later version cannot read must not keep the others from going on.
      spdlog::error("job passed over: job={} error=\"{}\"", id, std::string(spec.status().message()));
      continue;
    }
    CatalogueJob& job = jobs_[id];
    job = {.added = std::move(stored.added), .spec = *std::move(spec)};
    job_order_.push_back(id);
    sequence->second.jobs.push_back(id);
    turn.Apply(core::JobSubmitted{.id = id,
                                  .name = sequence->second.opened.name,
                                  .user = job.added.user,
                                  .priority = job.added.priority,
                                  .cancelled = stored.cancelled,
                                  .failures = std::move(stored.failures)});
    PlanWhole(turn, job, sequence->second);
  }
  return absl::OkStatus();
}

absl::StatusOr<const CatalogueSequence*> Catalogue::Open(Turn& turn, store::SequenceOpened asked) {
  const auto name = std::pair(asked.session, asked.name);
  if (const auto found = sequence_by_name_.find(name); found != sequence_by_name_.end()) {
    const CatalogueSequence& sequence = sequences_.at(found->second);
    const store::SequenceOpened& have = sequence.opened;
    if (have.frames_per_second != asked.frames_per_second || have.metres_per_unit != asked.metres_per_unit || have.up != asked.up) {
      return absl::AlreadyExistsError(
          fmt::format("take \"{}\" of session \"{}\" exists with {} frames a second, {} metres a unit, up {}; use these or another name", have.name,
                      have.session, have.frames_per_second, have.metres_per_unit, have.up));
    }
    return &sequence;
  }
  asked.id = fmt::format("s{}", sequences_.size() + 1);
  sequence_by_name_.emplace(name, asked.id);
  turn.Record(asked);
  CatalogueSequence& sequence = sequences_[asked.id];
  sequence.opened = std::move(asked);
  return &sequence;
}

absl::StatusOr<const CatalogueSequence*> Catalogue::Add(Turn& turn, const std::string& id, std::vector<store::FrameAdded> frames) {
  const auto found = sequences_.find(id);
  if (found == sequences_.end()) return FindSequence(id);
  CatalogueSequence& sequence = found->second;
  std::map<std::int32_t, store::FrameAdded> fresh;
  for (store::FrameAdded& frame : frames) {
    frame.sequence = id;
    const std::int32_t number = frame.number;
    const auto known = sequence.frames.find(number);
    const auto repeated = fresh.find(number);
    const store::FrameAdded* before = known != sequence.frames.end() ? &known->second : repeated != fresh.end() ? &repeated->second : nullptr;
    if (!before) {
      fresh.emplace(number, std::move(frame));
    } else if (before->blob != frame.blob || before->extension != frame.extension) {
      return absl::AlreadyExistsError(fmt::format("frame {} stands for another file already ({})", number, before->blob.Short()));
    }
  }
  if (fresh.empty()) return &sequence;
  if (sequence.frames.size() + fresh.size() > tasks::kFramesMax) {
    return absl::InvalidArgumentError(fmt::format("a take has at most {} frames; split it", tasks::kFramesMax));
  }
  if (sequence.closed) {
    return absl::FailedPreconditionError(
        fmt::format("take \"{}\" of session \"{}\" is closed; open another name for more frames", sequence.opened.name, sequence.opened.session));
  }
  std::vector<store::FrameAdded> added;
  for (auto& [number, frame] : fresh) {
    turn.Record(frame);
    sequence.frames.emplace(number, frame);
    added.push_back(std::move(frame));
  }
  for (const std::string& job : sequence.jobs) Plan(turn, jobs_.at(job), sequence, added);
  return &sequence;
}

absl::StatusOr<const CatalogueSequence*> Catalogue::Close(Turn& turn, const std::string& id) {
  const auto found = sequences_.find(id);
  if (found == sequences_.end()) return FindSequence(id);
  CatalogueSequence& sequence = found->second;
  if (sequence.closed) return &sequence;
  sequence.closed = true;
  turn.Record(store::SequenceClosed{id});
  for (const std::string& job : sequence.jobs) PlanWhole(turn, jobs_.at(job), sequence);
  return &sequence;
}

absl::StatusOr<std::string> Catalogue::Submit(Turn& turn, const std::string& sequence_id, const std::string& user, std::int32_t priority,
                                              plan::JobSpec spec) {
  const auto found = sequences_.find(sequence_id);
  if (found == sequences_.end()) return FindSequence(sequence_id).status();
  const std::string id = fmt::format("j{}", jobs_.size() + 1);
  CatalogueJob& job = jobs_[id];
  job.added = {.id = id, .sequence = sequence_id, .user = user, .priority = priority, .spec_json = plan::ToJson(spec).dump()};
  job.spec = std::move(spec);
  job_order_.push_back(id);
  found->second.jobs.push_back(id);
  turn.Record(job.added);
  turn.Apply(core::JobSubmitted{.id = id, .name = found->second.opened.name, .user = user, .priority = priority});
  PlanWhole(turn, job, found->second);
  return id;
}

absl::StatusOr<const CatalogueSequence*> Catalogue::FindSequence(const std::string& id) const {
  const auto found = sequences_.find(id);
  if (found == sequences_.end()) return absl::NotFoundError(fmt::format("there is no sequence \"{}\"", id));
  return &found->second;
}

absl::StatusOr<const CatalogueJob*> Catalogue::FindJob(const std::string& id) const {
  const auto found = jobs_.find(id);
  if (found == jobs_.end()) return absl::NotFoundError(fmt::format("there is no job \"{}\"; 'vorocast status' names those there are", id));
  return &found->second;
}

}  // namespace vorocast::server
