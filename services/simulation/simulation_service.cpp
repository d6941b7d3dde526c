// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/simulation_service.h"

#include <fmt/format.h>

#include <future>

#include "services/lease/attempt.h"
#include "services/lease/input_check.h"
#include "services/rpc/status.h"
#include "services/simulation/effect.h"
#include "services/simulation/shipped_effects.h"
#include "services/simulation/simulate_executor.h"
#include "services/storage/hdf5_artifacts.h"

namespace vorocast::simulation {
namespace {

constexpr auto kReportInterval = std::chrono::milliseconds(200);

/// Counts a run for as long as it lives.
class RunCount {
 public:
  explicit RunCount(std::atomic<std::int32_t>& runs) : runs_(runs), number_(++runs) {}
  ~RunCount() { --runs_; }
  RunCount(const RunCount&) = delete;
  RunCount& operator=(const RunCount&) = delete;
  std::int32_t number() const { return number_; }

 private:
  std::atomic<std::int32_t>& runs_;
  const std::int32_t number_;
};

absl::Status StatusOf(const v1::Failed& failed) {
  switch (failed.cause()) {
    case v1::Failed::INPUT:
      return absl::InvalidArgumentError(failed.message());
    case v1::Failed::OUT_OF_MEMORY:
      return absl::ResourceExhaustedError(failed.message());
    case v1::Failed::STORE:
      return absl::UnavailableError(failed.message());
    case v1::Failed::DRAINED:
      return absl::CancelledError(failed.message());
    default:
      return absl::InternalError(failed.message());
  }
}

}  // namespace

SimulationService::SimulationService(Options options)
    : options_(std::move(options)),
      live_({.open_take = [this](const std::string& key) { return OpenTake(key); },
             .sessions_max = options_.live_max,
             .idle_max = options_.live_idle}) {}

absl::StatusOr<std::shared_ptr<const geometry::TrackedTake>> SimulationService::OpenTake(const std::string& key) {
  ASSIGN_OR_RETURN(const base::Digest digest, rpc::ParseDigest(key, "tracked_key"));
  if (!options_.store.HasArtifact(digest, ".h5")) {
    return absl::NotFoundError(fmt::format("tracked_key: there is no artifact {} in the folder", digest.Hex()));
  }
  // One read at a time: two sessions that open the same take at once need it once.
  const std::lock_guard lock(mutex_);
  std::erase_if(takes_, [](const auto& entry) { return entry.second.expired(); });
  if (auto known = takes_[digest.Hex()].lock()) return known;
  ASSIGN_OR_RETURN(geometry::TrackedTake take, storage::ReadTrackedTake(options_.store.ArtifactPath(digest, ".h5")));
  auto shared = std::make_shared<const geometry::TrackedTake>(std::move(take));
  takes_[digest.Hex()] = shared;
  return shared;
}

grpc::Status SimulationService::Effects(grpc::ServerContext*, const v1::EffectsRequest*, v1::EffectsReply* reply) {
  for (const std::string& name : ShippedEffects()) {
    const auto effect = LoadEffect(name);
    if (!effect.ok()) return rpc::ToGrpc(effect.status());
    v1::ShippedEffect& shipped = *reply->add_effects();
    shipped.set_name(name);
    shipped.set_description((*effect)["description"].get<std::string>());
    shipped.set_effect_json(effect->dump());
  }
  reply->set_schema_json(std::string(EffectSchemaText()));
  return grpc::Status::OK;
}

grpc::Status SimulationService::Check(grpc::ServerContext*, const v1::CheckRequest* request, v1::CheckReply* reply) {
  const auto effect = ParseEffect(request->effect_json());
  if (!effect.ok()) return rpc::ToGrpc(effect.status());
  reply->set_effect_json(effect->dump());
  return grpc::Status::OK;
}

grpc::Status SimulationService::Run(grpc::ServerContext* context, const v1::RunRequest* request, grpc::ServerWriter<v1::RunProgress>* writer) {
  const auto effect = ParseEffect(request->effect_json());
  if (!effect.ok()) return rpc::ToGrpc(effect.status());
  const auto tracked = rpc::ParseDigest(request->tracked_key(), "tracked_key");
  if (!tracked.ok()) return rpc::ToGrpc(tracked.status());
  if (!options_.store.HasArtifact(*tracked, ".h5")) {
    return rpc::ToGrpc(absl::NotFoundError(fmt::format("tracked_key: there is no artifact {} in the folder", tracked->Hex())));
  }
  const RunCount count(runs_);
  if (count.number() > options_.runs_max) {
    return rpc::ToGrpc(absl::ResourceExhaustedError(fmt::format("{} runs are under way already; try again when one has ended", options_.runs_max)));
  }

  const tasks::TaskSpec spec = SimulateTask(*tracked, *effect);
  v1::Lease lease;
  lease.mutable_id()->set_task_id("run");
  lease.set_label("simulate");
  lease.set_spec_json(tasks::ToJson(spec).dump());
  std::promise<v1::Finished> promise;
  std::future<v1::Finished> ended = promise.get_future();
  lease::InputCheck inputs;
  lease::Attempt attempt(lease, options_.program, options_.store, inputs, [&](v1::Finished finished) { promise.set_value(std::move(finished)); });
  v1::RunProgress progress;
  while (ended.wait_for(kReportInterval) != std::future_status::ready) {
    if (context->IsCancelled()) {
      attempt.Stop();
      break;
    }
    if (attempt.fraction() <= progress.fraction()) continue;
    progress.set_fraction(attempt.fraction());
    writer->Write(progress);
  }
  const v1::Finished finished = ended.get();
  if (finished.has_failed()) return rpc::ToGrpc(StatusOf(finished.failed()));
  progress.set_fraction(1);
  progress.set_simulated_key(spec.Key().Hex());
  writer->Write(progress);
  return grpc::Status::OK;
}

}  // namespace vorocast::simulation
