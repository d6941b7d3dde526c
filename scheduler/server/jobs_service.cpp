// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/jobs_service.h"

#include <charconv>
#include <string_view>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "scheduler/core/job_view.h"
#include "scheduler/server/archive.h"
#include "scheduler/server/attempts_call.h"
#include "scheduler/server/fleet_message.h"
#include "scheduler/server/job_message.h"
#include "scheduler/server/job_request.h"
#include "scheduler/server/unary_call.h"

namespace vorocast::server {
namespace {

constexpr std::int32_t kListed = 50;
constexpr std::int32_t kListedMax = 10'000;
constexpr std::string_view kCapture = "capture/";

/// "capture/frame_000412.ply" is frame 412, if that came as PLY.
absl::StatusOr<store::FrameAdded> FindCapturedFrame(const Catalogue& catalogue, const CatalogueSequence& sequence, const std::string& name) {
  constexpr std::string_view kFrame = "capture/frame_";
  const auto unknown = absl::NotFoundError(fmt::format("there is no \"{}\"; a captured frame is named like capture/frame_000412.ply", name));
  if (!name.starts_with(kFrame)) return unknown;
  std::int32_t number = 0;
  const char* const end = name.data() + name.size();
  const auto [dot, error] = std::from_chars(name.data() + kFrame.size(), end, number);
  if (error != std::errc() || number < 0) return unknown;
  ASSIGN_OR_RETURN(const store::FrameAdded frame, catalogue.FindFrame(sequence, number));
  if (std::string_view(dot, static_cast<std::size_t>(end - dot)) != frame.extension) return unknown;
  return frame;
}

}  // namespace

absl::Status JobsService::Show(Turn& turn, const std::string& id, v1::Job& reply) const {
  ASSIGN_OR_RETURN(const CatalogueJob* job, catalogue_.FindJob(id));
  ASSIGN_OR_RETURN(reply, JobMessage(turn.state(), catalogue_, *job, FrameOutputs::kListed));
  return absl::OkStatus();
}

absl::StatusOr<JobsService::OutputFile> JobsService::FindOutput(Turn& turn, const std::string& id, const std::string& name) const {
  ASSIGN_OR_RETURN(const CatalogueJob* known, catalogue_.FindJob(id));
  if (name.starts_with(kCapture)) {
    ASSIGN_OR_RETURN(const CatalogueSequence* sequence, catalogue_.FindSequence(known->added.sequence));
    ASSIGN_OR_RETURN(const store::FrameAdded frame, FindCapturedFrame(catalogue_, *sequence, name));
    return OutputFile{artifacts_.BlobPath(frame.blob, frame.extension), frame.blob.Hex()};
  }
  if (const core::Job* job = core::FindJob(turn.state(), id)) {
    ASSIGN_OR_RETURN(const core::OutputView output, core::FindOutput(turn.state(), *job, name));
    return OutputFile{artifacts_.ArtifactPath(output.key, output.extension), output.result.sha256.Hex()};
  }
  ASSIGN_OR_RETURN(const v1::Output output, FindEndedOutput(catalogue_, id, name));
  ASSIGN_OR_RETURN(const base::Digest key, base::Digest::FromHex(output.key()));
  return OutputFile{artifacts_.ArtifactPath(key, std::filesystem::path(name).extension().string()), output.sha256()};
}

grpc::ServerUnaryReactor* JobsService::Submit(grpc::CallbackServerContext* context, const v1::SubmitJobRequest* request, v1::Job* reply) {
  auto spec = SpecOf(*request);
  if (!spec.ok()) return Answer(context, spec.status());
  const auto terms = TermsOf(*request);
  if (!terms.ok()) return Answer(context, terms.status());
  const auto caller = rpc::CallerOf(*context, gate_);
  if (!caller.ok()) return Answer(context, caller.status());
  // Whose token it is, that user's job it is, whatever the client says.
  const std::string user = caller->known ? caller->name : request->user();
  return AnswerInTurn<v1::Job>(
      context, engine_, reply, [this, request, user, asked = *std::move(spec), terms = *terms](Turn& turn, v1::Job& job) -> absl::Status {
        plan::JobSpec whole = asked;
        ASSIGN_OR_RETURN(const CatalogueSequence* sequence, catalogue_.FindSequence(request->sequence_id()));
        SetCapture(sequence->opened, whole);
        if (!request->onto_sequence_id().empty()) {
          const auto onto = catalogue_.FindSequence(request->onto_sequence_id());
          if (!onto.ok()) return base::Annotate(onto.status(), "onto_sequence_id");
          SetOnto((*onto)->opened, whole);
        }
        ASSIGN_OR_RETURN(const std::string id, catalogue_.Submit(turn, request->sequence_id(), user, request->priority(), std::move(whole), terms));
        spdlog::info("job submitted: job={} sequence={} take=\"{}\" user=\"{}\" priority={}", id, request->sequence_id(), sequence->opened.name, user,
                     request->priority());
        return Show(turn, id, job);
      });
}

grpc::ServerUnaryReactor* JobsService::Get(grpc::CallbackServerContext* context, const v1::JobRequest* request, v1::Job* reply) {
  return AnswerInTurn<v1::Job>(context, engine_, reply, [this, request](Turn& turn, v1::Job& job) { return Show(turn, request->job_id(), job); });
}

grpc::ServerUnaryReactor* JobsService::List(grpc::CallbackServerContext* context, const v1::ListJobsRequest* request, v1::ListJobsReply* reply) {
  const std::int32_t limit = request->limit() == 0 ? kListed : request->limit();
  if (limit < 0 || limit > kListedMax) return Answer(context, absl::InvalidArgumentError(fmt::format("limit must be from 0 to {}", kListedMax)));
  return AnswerInTurn<v1::ListJobsReply>(context, engine_, reply,
                                         [this, limit, session = request->session()](Turn& turn, v1::ListJobsReply& list) -> absl::Status {
                                           list.mutable_fleet()->set_description(fleet_.Text());
                                           const auto& order = catalogue_.job_order();
                                           for (auto id = order.rbegin(); id != order.rend() && list.jobs_size() < limit; ++id) {
                                             ASSIGN_OR_RETURN(const CatalogueJob* job, catalogue_.FindJob(*id));
                                             ASSIGN_OR_RETURN(const CatalogueSequence* sequence, catalogue_.FindSequence(job->added.sequence));
                                             if (!session.empty() && sequence->opened.session != session) continue;
                                             ASSIGN_OR_RETURN(*list.add_jobs(), JobMessage(turn.state(), catalogue_, *job, FrameOutputs::kLeftOut));
                                           }
                                           FillFleet(turn.state(), *list.mutable_fleet());
                                           return absl::OkStatus();
                                         });
}

grpc::ServerWriteReactor<v1::Job>* JobsService::Watch(grpc::CallbackServerContext*, const v1::JobRequest* request) {
  const std::shared_ptr<WatchCall> call = WatchCall::Make();
  const absl::Status accepted = engine_.Ask([this, call, id = request->job_id()](Turn& turn) {
    const auto job = catalogue_.FindJob(id);
    if (!job.ok()) return turn.After([call, status = job.status()] { call->End(status); });
    watchers_.Add(turn, **job, call);
  });
  if (!accepted.ok()) call->End(accepted);
  return call.get();
}

grpc::ServerUnaryReactor* JobsService::Explain(grpc::CallbackServerContext* context, const v1::ExplainRequest* request, v1::ExplainReply* reply) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const absl::Status accepted = engine_.Ask([this, reactor, request, reply](Turn& turn) {
    const absl::Status known = catalogue_.FindJob(request->job_id()).status();
    const core::Job* job = core::FindJob(turn.state(), request->job_id());
    if (known.ok() && !job) {
      // From the record, which may take a while to read.
      return turn.After([this, reactor, request, reply] {
        disk_.Run([this, reactor, request, reply] {
          auto text = ExplainEnded(catalogue_, request->job_id(), TaskLabel(request->job_id(), request->task()));
          if (text.ok()) reply->set_text(*std::move(text));
          reactor->Finish(rpc::ToGrpc(text.status()));
        });
      });
    }
    const auto explain = [&]() -> absl::StatusOr<std::string> {
      RETURN_IF_ERROR(known);
      if (request->task().empty()) return core::Explain(turn.state(), *job) + ExplainLateness(turn.state(), *job, WallSeconds());
      return core::Explain(turn.state(), *job, request->task());
    };
    auto text = explain();
    if (text.ok()) reply->set_text(*std::move(text));
    turn.Answer([reactor, status = text.status()](const absl::Status& durable) { reactor->Finish(rpc::ToGrpc(durable.ok() ? status : durable)); });
  });
  if (!accepted.ok()) reactor->Finish(rpc::ToGrpc(accepted));
  return reactor;
}

grpc::ServerUnaryReactor* JobsService::Change(grpc::CallbackServerContext* context, const std::string& id, v1::Job* reply,
                                              std::function<absl::Status(Turn&)> change) {
  auto caller = rpc::CallerOf(*context, gate_);
  if (!caller.ok()) return Answer(context, caller.status());
  return AnswerInTurn<v1::Job>(context, engine_, reply,
                               [this, id, by = *std::move(caller), change = std::move(change)](Turn& turn, v1::Job& job) -> absl::Status {
                                 ASSIGN_OR_RETURN(const CatalogueJob* known, catalogue_.FindJob(id));
                                 if (!by.MayChange(known->added.user)) {
                                   return absl::PermissionDeniedError(
                                       fmt::format("job {} belongs to {}; to change it, {} needs the role operate", id, known->added.user, by.name));
                                 }
                                 RETURN_IF_ERROR(change(turn));
                                 return Show(turn, id, job);
                               });
}

grpc::ServerUnaryReactor* JobsService::Cancel(grpc::CallbackServerContext* context, const v1::JobRequest* request, v1::Job* reply) {
  return Change(context, request->job_id(), reply, [request](Turn& turn) {
    turn.Apply(core::CancelJob{request->job_id()});
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* JobsService::Retry(grpc::CallbackServerContext* context, const v1::RetryJobRequest* request, v1::Job* reply) {
  return Change(context, request->job_id(), reply, [this, request](Turn& turn) -> absl::Status {
    ASSIGN_OR_RETURN(const CatalogueJob* known, catalogue_.FindJob(request->job_id()));
    core::JobTerms terms = known->added.terms;
    RETURN_IF_ERROR(SetLimits(*request, terms));
    return catalogue_.Retry(turn, request->job_id(), terms);
  });
}

grpc::ServerUnaryReactor* JobsService::SetPaused(grpc::CallbackServerContext* context, const v1::JobRequest* request, v1::Job* reply, bool paused) {
  return Change(context, request->job_id(), reply, [this, request, paused](Turn& turn) { return catalogue_.Pause(turn, request->job_id(), paused); });
}
grpc::ServerUnaryReactor* JobsService::Pause(grpc::CallbackServerContext* context, const v1::JobRequest* request, v1::Job* reply) {
  return SetPaused(context, request, reply, true);
}
grpc::ServerUnaryReactor* JobsService::Resume(grpc::CallbackServerContext* context, const v1::JobRequest* request, v1::Job* reply) {
  return SetPaused(context, request, reply, false);
}

grpc::ServerWriteReactor<v1::FetchChunk>* JobsService::Fetch(grpc::CallbackServerContext*, const v1::FetchRequest* request) {
  auto* call = new FetchCall(disk_);
  const absl::Status accepted = engine_.Ask([this, call, id = request->job_id(), name = request->name()](Turn& turn) {
    const auto output = FindOutput(turn, id, name);
    if (!output.ok()) return turn.After([call, status = output.status()] { call->Refuse(status); });
    turn.After([call, path = output->path, sha256 = output->sha256] { call->Send(path, sha256); });
  });
  if (!accepted.ok()) call->Refuse(accepted);
  return call;
}

grpc::ServerWriteReactor<v1::AttemptsReply>* JobsService::Attempts(grpc::CallbackServerContext*, const v1::AttemptsRequest* request) {
  auto* call = new AttemptsCall(catalogue_, disk_, *request);
  const absl::Status accepted = engine_.Ask([this, call, id = request->job_id(), task = request->task()](Turn& turn) {
    const absl::Status known = catalogue_.FindJob(id).status();
    if (!known.ok()) return turn.After([call, known] { call->Refuse(known); });
    std::vector<v1::TaskAttempt> running;
    if (const core::Job* job = core::FindJob(turn.state(), id)) running = RunningAttempts(turn.state(), *job, TaskLabel(id, task));
    // After the commit: whatever ended before is on record then.
    turn.After([call, running = std::move(running)]() mutable { call->Send(std::move(running)); });
  });
  if (!accepted.ok()) call->Refuse(accepted);
  return call;
}

}  // namespace vorocast::server
