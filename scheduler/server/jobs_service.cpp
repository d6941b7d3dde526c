// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/jobs_service.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "scheduler/core/job_view.h"
#include "scheduler/server/job_message.h"
#include "scheduler/server/job_request.h"
#include "scheduler/server/unary_call.h"
#include "services/base/check.h"

namespace vorocast::server {
namespace {

constexpr std::int32_t kListed = 50;
constexpr std::int32_t kListedMax = 10'000;

const absl::Status kOverloaded = absl::UnavailableError("the scheduler is stopping or overloaded; try again");

}  // namespace

absl::Status JobsService::Show(Turn& turn, const std::string& id, v1::Job& reply) const {
  ASSIGN_OR_RETURN(const CatalogueJob* job, catalogue_.FindJob(id));
  reply = JobMessage(turn.state(), catalogue_, *job, FrameOutputs::kListed);
  return absl::OkStatus();
}

grpc::ServerUnaryReactor* JobsService::Submit(grpc::CallbackServerContext* context, const v1::SubmitJobRequest* request, v1::Job* reply) {
  auto spec = SpecOf(*request);
  if (!spec.ok()) return Answer(context, spec.status());
  return AnswerInTurn<v1::Job>(context, engine_, reply, [this, request, asked = *std::move(spec)](Turn& turn, v1::Job& job) -> absl::Status {
    plan::JobSpec whole = asked;
    ASSIGN_OR_RETURN(const CatalogueSequence* sequence, catalogue_.FindSequence(request->sequence_id()));
    SetCapture(sequence->opened, whole);
    ASSIGN_OR_RETURN(const std::string id, catalogue_.Submit(turn, request->sequence_id(), request->user(), request->priority(), std::move(whole)));
    spdlog::info("job submitted: job={} sequence={} take=\"{}\" user=\"{}\" priority={}", id, request->sequence_id(), sequence->opened.name,
                 request->user(), request->priority());
    return Show(turn, id, job);
  });
}

grpc::ServerUnaryReactor* JobsService::Get(grpc::CallbackServerContext* context, const v1::JobRequest* request, v1::Job* reply) {
  return AnswerInTurn<v1::Job>(context, engine_, reply, [this, request](Turn& turn, v1::Job& job) { return Show(turn, request->job_id(), job); });
}

grpc::ServerUnaryReactor* JobsService::List(grpc::CallbackServerContext* context, const v1::ListJobsRequest* request, v1::ListJobsReply* reply) {
  const std::int32_t limit = request->limit() == 0 ? kListed : request->limit();
  if (limit < 0 || limit > kListedMax) return Answer(context, absl::InvalidArgumentError(fmt::format("limit must be from 0 to {}", kListedMax)));
  return AnswerInTurn<v1::ListJobsReply>(context, engine_, reply, [this, limit](Turn& turn, v1::ListJobsReply& list) -> absl::Status {
    const auto& order = catalogue_.job_order();
    for (auto id = order.rbegin(); id != order.rend() && list.jobs_size() < limit; ++id) {
      ASSIGN_OR_RETURN(const CatalogueJob* job, catalogue_.FindJob(*id));
      *list.add_jobs() = JobMessage(turn.state(), catalogue_, *job, FrameOutputs::kLeftOut);
    }
    return absl::OkStatus();
  });
}

grpc::ServerWriteReactor<v1::Job>* JobsService::Watch(grpc::CallbackServerContext*, const v1::JobRequest* request) {
  const std::shared_ptr<WatchCall> call = WatchCall::Make();
  const bool accepted = engine_.Submit([this, call, id = request->job_id()](Turn& turn) {
    const auto job = catalogue_.FindJob(id);
    if (!job.ok()) return turn.After([call, status = job.status()] { call->End(status); });
    watchers_.Add(turn, **job, call);
  });
  if (!accepted) call->End(kOverloaded);
  return call.get();
}

grpc::ServerUnaryReactor* JobsService::Explain(grpc::CallbackServerContext* context, const v1::ExplainRequest* request, v1::ExplainReply* reply) {
  return AnswerInTurn<v1::ExplainReply>(context, engine_, reply, [this, request](Turn& turn, v1::ExplainReply& explained) -> absl::Status {
    RETURN_IF_ERROR(catalogue_.FindJob(request->job_id()).status());
    const core::Job* job = core::FindJob(turn.state(), request->job_id());
    VOROCAST_CHECK(job);
    if (request->task().empty()) {
      explained.set_text(core::Explain(turn.state(), *job));
      return absl::OkStatus();
    }
    ASSIGN_OR_RETURN(*explained.mutable_text(), core::Explain(turn.state(), *job, request->task()));
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* JobsService::Cancel(grpc::CallbackServerContext* context, const v1::JobRequest* request, v1::Job* reply) {
  return AnswerInTurn<v1::Job>(context, engine_, reply, [this, request](Turn& turn, v1::Job& job) {
    turn.Apply(core::CancelJob{request->job_id()});
    return Show(turn, request->job_id(), job);
  });
}

grpc::ServerUnaryReactor* JobsService::Retry(grpc::CallbackServerContext* context, const v1::JobRequest* request, v1::Job* reply) {
  return AnswerInTurn<v1::Job>(context, engine_, reply, [this, request](Turn& turn, v1::Job& job) {
    turn.Apply(core::RetryJob{request->job_id()});
    return Show(turn, request->job_id(), job);
  });
}

grpc::ServerWriteReactor<v1::FetchChunk>* JobsService::Fetch(grpc::CallbackServerContext*, const v1::FetchRequest* request) {
  auto* call = new FetchCall(disk_);
  const bool accepted = engine_.Submit([this, call, id = request->job_id(), name = request->name()](Turn& turn) {
    const core::Job* job = core::FindJob(turn.state(), id);
    const auto output = job ? core::FindOutput(turn.state(), *job, name) : absl::StatusOr<core::OutputView>(catalogue_.FindJob(id).status());
    if (!output.ok()) return turn.After([call, status = output.status()] { call->Refuse(status); });
    turn.After(
        [call, path = artifacts_.ArtifactPath(output->key, output->extension), sha256 = output->result.sha256.Hex()] { call->Send(path, sha256); });
  });
  if (!accepted) call->Refuse(kOverloaded);
  return call;
}

}  // namespace vorocast::server
