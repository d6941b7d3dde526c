// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/job_message.h"

#include <fmt/format.h>

#include "scheduler/core/job_view.h"
#include "services/base/check.h"

namespace vorocast::server {
namespace {

v1::State StateOf(core::Phase phase) {
  switch (phase) {
    case core::Phase::kBlocked:
      return v1::BLOCKED;
    case core::Phase::kReady:
      return v1::READY;
    case core::Phase::kRunning:
      return v1::RUNNING;
    case core::Phase::kDone:
      return v1::DONE;
    case core::Phase::kFailed:
      return v1::FAILED;
    case core::Phase::kCancelled:
      return v1::CANCELLED;
  }
  VOROCAST_CHECK(false && "unknown phase");
}

/// What is known of it without the core.
void FillTerms(const CatalogueSequence& sequence, const CatalogueJob& job, v1::Job& message) {
  message.set_session(sequence.opened.session);
  message.set_paused(job.paused);
  message.set_priority(job.added.priority);
  message.set_workers_max(job.added.terms.workers_max);
  message.set_deadline(job.added.terms.deadline);
  message.set_submitted(job.added.submitted);
}

}  // namespace

absl::StatusOr<v1::Job> JobMessage(const core::State& state, const Catalogue& catalogue, const CatalogueJob& job, FrameOutputs frames) {
  const auto sequence = catalogue.FindSequence(job.added.sequence);
  VOROCAST_CHECK(sequence.ok());
  const core::Job* known = core::FindJob(state, job.added.id);
  if (!known) {
    v1::Job ended;
    ASSIGN_OR_RETURN(const std::string bytes,
                     catalogue.EndedText(job.added.id, frames == FrameOutputs::kListed ? store::JobText::kWhole : store::JobText::kSummary));
    if (!ended.ParseFromString(bytes)) return absl::DataLossError(fmt::format("the record of job {} cannot be read", job.added.id));
    FillTerms(**sequence, job, ended);
    return ended;
  }
  const core::JobView view = core::View(state, *known);

  v1::Job message;
  message.set_id(job.added.id);
  message.set_sequence_id(job.added.sequence);
  message.set_sequence_name((*sequence)->opened.name);
  message.set_sequence_closed((*sequence)->closed);
  if (!job.onto.empty()) {
    const auto onto = catalogue.FindSequence(job.onto);
    VOROCAST_CHECK(onto.ok());
    message.set_onto_sequence_name((*onto)->opened.name);
    message.set_sequence_closed((*sequence)->closed && (*onto)->closed);
  }
  message.set_user(job.added.user);
  message.set_state(StateOf(view.phase));
  message.set_seconds_left(view.seconds_left);
  FillTerms(**sequence, job, message);
  // Until it is on record, it ended just now.
  if (HasEnded(message.state())) message.set_ended(job.ended_at > 0 ? job.ended_at : WallSeconds());
  for (const core::StageView& seen : view.stages) {
    v1::Stage& stage = *message.add_stages();
    stage.set_kind(std::string(tasks::Name(seen.kind)));
    stage.set_total(seen.total);
    stage.set_done(seen.done);
    stage.set_reused(seen.reused);
    stage.set_running(seen.running);
    stage.set_failed(seen.failed);
    stage.set_cancelled(seen.cancelled);
    stage.set_seconds_mean(seen.seconds_mean);
    stage.set_fraction(seen.fraction);
  }
  for (const core::FailureView& seen : view.failures) {
    v1::FailedTask& failure = *message.add_failures();
    failure.set_task_id(seen.task_id);
    failure.set_label(seen.label);
    failure.set_cause(seen.cause);
  }
  for (const core::OutputView& seen : core::Outputs(state, *known, frames == FrameOutputs::kListed)) {
    v1::Output& output = *message.add_outputs();
    output.set_name(seen.name);
    output.set_key(seen.key.Hex());
    output.set_sha256(seen.result.sha256.Hex());
    output.set_size(seen.result.size);
  }
  return message;
}

}  // namespace vorocast::server
