// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/catalogue.h"

#include <algorithm>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "scheduler/core/state.h"
#include "services/base/status.h"

namespace vorocast::server {
namespace {

/// Milliseconds of work.
constexpr std::size_t kTasksATurn = 250;

std::vector<plan::PlannedFrame> PlannedFrames(const std::vector<store::FrameAdded>& frames) {
  std::vector<plan::PlannedFrame> planned;
  planned.reserve(frames.size());
  for (const store::FrameAdded& frame : frames) planned.push_back({.number = frame.number, .blob = frame.blob, .extension = frame.extension});
  return planned;
}

absl::StatusOr<plan::JobSpec> SpecOf(const CatalogueJob& job) {
  return plan::JobSpecFromJson(nlohmann::json::parse(job.added.spec_json, nullptr, false));
}

/// Empty for a job with one take, or none that can be read: planning it says so.
std::string OntoOf(const CatalogueJob& job) {
  const auto spec = SpecOf(job);
  return spec.ok() && spec->onto ? spec->onto->sequence : "";
}

/// Frames of one of a job's sequences, for that of its takes that they belong to: for both, if they are the same.
plan::KnownTake Added(const std::vector<store::FrameAdded>& frames, const std::string& sequence) {
  if (frames.empty() || frames.front().sequence != sequence) return {};
  return {.frames = PlannedFrames(frames)};
}

}  // namespace

void Catalogue::Plan(const CatalogueJob& job, std::optional<std::vector<store::FrameAdded>> frames) {
  const auto less_urgent = [](std::int32_t priority, const Planning& planning) { return priority > planning.priority; };
  const auto place = std::upper_bound(plannings_.begin(), plannings_.end(), job.added.priority, less_urgent);
  plannings_.insert(place, {.job = job.added.id, .priority = job.added.priority, .frames = std::move(frames)});
}

absl::StatusOr<plan::KnownTake> Catalogue::AllKnown(CatalogueSequence& sequence) const {
  RETURN_IF_ERROR(NeedFrames(sequence));
  std::vector<store::FrameAdded> frames;
  for (const auto& [number, frame] : *sequence.frames) frames.push_back(frame);
  return plan::KnownTake{.frames = PlannedFrames(frames), .closed = sequence.closed};
}

absl::Status Catalogue::Expand(Planning& planning) {
  const CatalogueJob& job = jobs_.at(planning.job);
  CatalogueSequence& sequence = sequences_.at(job.added.sequence);
  core::TasksAdded& added = planning.added.emplace(core::TasksAdded{.job = planning.job});
  const auto spec = SpecOf(job);
  if (!spec.ok()) {
    added.impossible = std::string(spec.status().message());
    return absl::OkStatus();
  }
  CatalogueSequence* onto_sequence = nullptr;
  if (spec->onto) {
    const auto found = sequences_.find(spec->onto->sequence);
    if (found == sequences_.end()) {
      added.impossible = fmt::format("its second take, sequence {}, is not on record", spec->onto->sequence);
      return absl::OkStatus();
    }
    onto_sequence = &found->second;
  }
  plan::KnownTake take, onto;
  if (planning.frames) {
    take = Added(*planning.frames, job.added.sequence);
    if (onto_sequence) onto = Added(*planning.frames, job.onto);
  } else {
    ASSIGN_OR_RETURN(take, AllKnown(sequence));
    if (onto_sequence) {
      ASSIGN_OR_RETURN(onto, AllKnown(*onto_sequence));
    }
  }
  added.complete = take.closed && (!onto_sequence || onto.closed);
  auto planned = plan::Plan(*spec, take.frames, take.closed, onto);
  if (!planned.ok()) {
    added.impossible = std::string(planned.status().message());
    return absl::OkStatus();
  }
  // Each take's own limit is kept where it is assembled; to stop early, the core counts the bad frames of both together.
  const std::int32_t takes = onto_sequence ? 2 : 1;
  if (spec->interpolated_max >= 0) added.bad_frames_max = takes * spec->interpolated_max;
  if (sequence.closed && (!onto_sequence || onto_sequence->closed)) {
    added.bad_frames_max = plan::InterpolatedMax(*spec, static_cast<std::int32_t>(sequence.frame_count));
    if (onto_sequence) added.bad_frames_max += plan::InterpolatedMax(*spec, static_cast<std::int32_t>(onto_sequence->frame_count));
  }
  added.tasks = *std::move(planned);
  return absl::OkStatus();
}

void Catalogue::Follow(const std::string& id) {
  CatalogueJob& job = jobs_.at(id);
  job.onto = OntoOf(job);
  if (!sequences_.contains(job.onto)) job.onto.clear();
  for (const std::string& sequence : {job.added.sequence, job.onto}) {
    const auto found = sequences_.find(sequence);
    if (found == sequences_.end()) continue;
    if (std::ranges::find(found->second.jobs, id) == found->second.jobs.end()) found->second.jobs.push_back(id);
  }
}

void Catalogue::Tidy(CatalogueSequence& sequence) const {
  const bool unused = std::all_of(sequence.jobs.begin(), sequence.jobs.end(), [this](const std::string& other) { return jobs_.at(other).ended; });
  if (sequence.closed && unused) sequence.frames.reset();
}

bool Catalogue::PlanSome(Turn& turn) {
  if (plannings_.empty()) return false;
  Planning& planning = plannings_.front();
  if (jobs_.at(planning.job).ended) {
    plannings_.pop_front();
    return !plannings_.empty();
  }
  if (!planning.added) {
    if (const absl::Status status = Expand(planning); !status.ok()) {
      // One job that cannot be read must not keep the others from going on.
      spdlog::error("job passed over: job={} error=\"{}\"", planning.job, std::string(status.message()));
      plannings_.pop_front();
      return !plannings_.empty();
    }
  }
  core::TasksAdded& all = *planning.added;
  const std::size_t last = std::min(all.tasks.size(), planning.next + kTasksATurn);
  if (planning.next == 0 && last == all.tasks.size()) {
    turn.Apply(std::move(all));
    plannings_.pop_front();
    return !plannings_.empty();
  }
  core::TasksAdded some{.job = all.job, .bad_frames_max = all.bad_frames_max};
  const auto from = all.tasks.begin() + static_cast<std::ptrdiff_t>(planning.next);
  const auto to = all.tasks.begin() + static_cast<std::ptrdiff_t>(last);
  some.tasks.assign(std::make_move_iterator(from), std::make_move_iterator(to));
  some.complete = all.complete && last == all.tasks.size();
  planning.next = last;
  turn.Apply(std::move(some));
  if (last == all.tasks.size()) plannings_.pop_front();
  return !plannings_.empty();
}

absl::Status Catalogue::NeedFrames(CatalogueSequence& sequence) const {
  if (sequence.frames) return absl::OkStatus();
  ASSIGN_OR_RETURN(std::vector<store::FrameAdded> frames, store_.LoadFrames(sequence.opened.id));
  sequence.frames.emplace();
  for (store::FrameAdded& frame : frames) sequence.frames->emplace(frame.number, std::move(frame));
  return absl::OkStatus();
}

core::JobSubmitted Catalogue::Submission(const CatalogueJob& job) const {
  return {.id = job.added.id,
          .name = sequences_.at(job.added.sequence).opened.name,
          .user = job.added.user,
          .priority = job.added.priority,
          .terms = job.added.terms,
          .paused = job.paused};
}

absl::Status Catalogue::Restore(Turn& turn, store::Snapshot snapshot) {
  turn.Apply(core::Restored{.runs = std::move(snapshot.runs), .attempt_next = snapshot.attempt_next});
  for (store::StoredSequence& stored : snapshot.sequences) {
    const std::string id = stored.opened.id;
    sequence_by_name_.emplace(std::pair(stored.opened.session, stored.opened.name), id);
    CatalogueSequence& sequence = sequences_[id];
    sequence.opened = std::move(stored.opened);
    sequence.closed = stored.closed;
    sequence.frame_count = stored.frame_count;
    if (!stored.frames) continue;
    sequence.frames.emplace();
    for (store::FrameAdded& frame : *stored.frames) sequence.frames->emplace_hint(sequence.frames->end(), frame.number, std::move(frame));
  }
  for (store::StoredJob& stored : snapshot.jobs) {
    const std::string id = stored.added.id;
    const auto sequence = sequences_.find(stored.added.sequence);
    if (sequence == sequences_.end())
      return absl::DataLossError(fmt::format("job {} belongs to sequence {}, which is not on record", id, stored.added.sequence));
    CatalogueJob& job = jobs_[id];
    job = {.added = std::move(stored.added), .ended = stored.ended, .paused = stored.paused, .ended_at = stored.ended_at, .onto = {}};
    job_order_.push_back(id);
    if (job.ended) {
      sequence->second.jobs.push_back(id);
      continue;
    }
    Follow(id);
    core::JobSubmitted submitted = Submission(job);
    submitted.cancelled = stored.cancelled;
    submitted.failures = std::move(stored.failures);
    turn.Apply(std::move(submitted));
    Plan(job);
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
  sequence.frames.emplace();
  return &sequence;
}

absl::StatusOr<const CatalogueSequence*> Catalogue::Add(Turn& turn, const std::string& id, std::vector<store::FrameAdded> frames) {
  const auto found = sequences_.find(id);
  if (found == sequences_.end()) return FindSequence(id);
  CatalogueSequence& sequence = found->second;
  const bool was_needed = sequence.frames.has_value();
  RETURN_IF_ERROR(NeedFrames(sequence));
  std::map<std::int32_t, store::FrameAdded> fresh;
  for (store::FrameAdded& frame : frames) {
    frame.sequence = id;
    const std::int32_t number = frame.number;
    const auto known = sequence.frames->find(number);
    const auto repeated = fresh.find(number);
    const store::FrameAdded* before = known != sequence.frames->end() ? &known->second : repeated != fresh.end() ? &repeated->second : nullptr;
    if (!before) {
      fresh.emplace(number, std::move(frame));
    } else if (before->blob != frame.blob || before->extension != frame.extension) {
      return absl::AlreadyExistsError(fmt::format("frame {} stands for another file already ({})", number, before->blob.Short()));
    }
  }
  if (fresh.empty()) {
    if (!was_needed) sequence.frames.reset();
    return &sequence;
  }
  if (sequence.frames->size() + fresh.size() > tasks::kFramesMax) {
    return absl::InvalidArgumentError(fmt::format("a take has at most {} frames; split it", tasks::kFramesMax));
  }
  if (sequence.closed) {
    return absl::FailedPreconditionError(
        fmt::format("take \"{}\" of session \"{}\" is closed; open another name for more frames", sequence.opened.name, sequence.opened.session));
  }
  std::vector<store::FrameAdded> added;
  for (auto& [number, frame] : fresh) {
    turn.Record(frame);
    sequence.frames->emplace(number, frame);
    added.push_back(std::move(frame));
  }
  sequence.frame_count = static_cast<std::int64_t>(sequence.frames->size());
  for (const std::string& job : sequence.jobs) Plan(jobs_.at(job), added);
  return &sequence;
}

absl::StatusOr<const CatalogueSequence*> Catalogue::Close(Turn& turn, const std::string& id) {
  const auto found = sequences_.find(id);
  if (found == sequences_.end()) return FindSequence(id);
  CatalogueSequence& sequence = found->second;
  if (sequence.closed) return &sequence;
  sequence.closed = true;
  turn.Record(store::SequenceClosed{id});
  for (const std::string& job : sequence.jobs) Plan(jobs_.at(job));
  return &sequence;
}

absl::StatusOr<std::string> Catalogue::Submit(Turn& turn, const std::string& sequence_id, const std::string& user, std::int32_t priority,
                                              plan::JobSpec spec, const core::JobTerms& terms) {
  const auto found = sequences_.find(sequence_id);
  if (found == sequences_.end()) return FindSequence(sequence_id).status();
  RETURN_IF_ERROR(NeedFrames(found->second));
  if (spec.onto) {
    RETURN_IF_ERROR(FindSequence(spec.onto->sequence).status());
    RETURN_IF_ERROR(NeedFrames(sequences_.at(spec.onto->sequence)));
  }
  const std::string id = fmt::format("j{}", jobs_.size() + 1);
  CatalogueJob& job = jobs_[id];
  job.added = {.id = id,
               .sequence = sequence_id,
               .user = user,
               .priority = priority,
               .spec_json = plan::ToJson(spec).dump(),
               .terms = terms,
               .submitted = WallSeconds()};
  job_order_.push_back(id);
  Follow(id);
  turn.Record(job.added);
  turn.Apply(Submission(job));
  Plan(job);
  return id;
}

absl::Status Catalogue::Pause(Turn& turn, const std::string& id, bool paused) {
  RETURN_IF_ERROR(FindJob(id).status());
  CatalogueJob& job = jobs_.at(id);
  const core::Job* known = core::FindJob(turn.state(), id);
  if (!known || core::IsOver(*known)) {
    return absl::FailedPreconditionError(fmt::format("job {} has ended; there is nothing to {}", id, paused ? "pause" : "resume"));
  }
  job.paused = paused;
  turn.Apply(core::PauseJob{id, paused});
  return absl::OkStatus();
}

absl::Status Catalogue::Retry(Turn& turn, const std::string& id, const core::JobTerms& terms) {
  RETURN_IF_ERROR(FindJob(id).status());
  CatalogueJob& job = jobs_.at(id);
  const CatalogueJob before = job;
  job.ended = false;
  job.ended_at = 0;
  const bool limited = terms.memory_limit != job.added.terms.memory_limit || terms.time_factor != job.added.terms.time_factor;
  job.added.terms = terms;
  if (core::FindJob(turn.state(), id)) {
    core::RetryJob retry{.job = id};
    if (limited) retry.memory_limit = terms.memory_limit, retry.time_factor = terms.time_factor;
    turn.Apply(retry);
    return absl::OkStatus();
  }
  Follow(id);
  CatalogueSequence& sequence = sequences_.at(job.added.sequence);
  absl::Status readable = NeedFrames(sequence);
  if (const auto onto = sequences_.find(job.onto); readable.ok() && onto != sequences_.end()) readable = NeedFrames(onto->second);
  if (!readable.ok()) {
    job = before;
    return readable;
  }
  turn.Record(core::Record(core::JobRetried{id}));
  if (limited) turn.Record(core::Record(core::JobLimited{id, terms.memory_limit, terms.time_factor}));
  core::JobSubmitted submitted = Submission(job);
  submitted.verify = true;
  turn.Apply(std::move(submitted));
  Plan(job);
  return absl::OkStatus();
}

void Catalogue::NoteEnd(const std::string& id, double at) {
  const auto found = jobs_.find(id);
  if (found != jobs_.end() && found->second.ended_at == 0) found->second.ended_at = at;
}

void Catalogue::End(const std::string& id) {
  CatalogueJob& job = jobs_.at(id);
  job.ended = true;
  Tidy(sequences_.at(job.added.sequence));
  if (const auto onto = sequences_.find(job.onto); onto != sequences_.end()) Tidy(onto->second);
}

absl::StatusOr<const CatalogueSequence*> Catalogue::FindSequence(const std::string& id) const {
  const auto found = sequences_.find(id);
  if (found == sequences_.end()) return absl::NotFoundError(fmt::format("there is no sequence \"{}\"", id));
  return &found->second;
}

absl::StatusOr<store::FrameAdded> Catalogue::FindFrame(const CatalogueSequence& sequence, std::int32_t number) const {
  const auto missing = absl::NotFoundError(fmt::format("take \"{}\" has no frame {}", sequence.opened.name, number));
  if (sequence.frames) {
    const auto found = sequence.frames->find(number);
    return found == sequence.frames->end() ? absl::StatusOr<store::FrameAdded>(missing) : found->second;
  }
  ASSIGN_OR_RETURN(const std::vector<store::FrameAdded> frames, store_.LoadFrames(sequence.opened.id));
  for (const store::FrameAdded& frame : frames) {
    if (frame.number == number) return frame;
  }
  return missing;
}

void Catalogue::AddFramesInUse(std::set<base::Digest>& blobs) const {
  for (const auto& [id, sequence] : sequences_) {
    if (!sequence.frames) continue;
    for (const auto& [number, frame] : *sequence.frames) blobs.insert(frame.blob);
  }
}

absl::StatusOr<const CatalogueJob*> Catalogue::FindJob(const std::string& id) const {
  const auto found = jobs_.find(id);
  if (found == jobs_.end()) return absl::NotFoundError(fmt::format("there is no job \"{}\"; 'vorocast status' names those there are", id));
  return &found->second;
}

}  // namespace vorocast::server
