// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/scheduler_server.h"

#include <chrono>
#include <cstdlib>
#include <future>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "scheduler/server/archive.h"
#include "scheduler/server/artifacts_service.h"
#include "scheduler/server/captures_service.h"
#include "scheduler/server/demand.h"
#include "scheduler/server/dispatch_service.h"
#include "scheduler/server/fleet_note.h"
#include "scheduler/server/jobs_service.h"
#include "scheduler/server/leadership_watch.h"
#include "scheduler/server/look_up_thread.h"
#include "scheduler/server/scheduler_metrics.h"
#include "scheduler/store/sqlite_store.h"
#include "services/rpc/server.h"

namespace vorocast::server {
namespace {

constexpr int kDiskThreads = 4;
constexpr absl::Duration kStopGrace = absl::Seconds(1);
constexpr auto kDemandPatience = std::chrono::seconds(10);

void EndProcess(const absl::Status& why) {
  const bool fenced = absl::IsFailedPrecondition(why);
  spdlog::critical("{}: {}{}", fenced ? "stepping down" : "giving up", std::string(why.message()),
                   fenced ? "; workers go on with the other one, and this one may be started again to stand by" : "");
  spdlog::shutdown();
  std::_Exit(fenced ? kSteppedDown : EXIT_FAILURE);
}

}  // namespace

/// In the order they are made; the destructor ends them in the order that none is used after its end.
struct SchedulerServer::Parts {
  Parts(std::unique_ptr<store::Store> leading, storage::ArtifactStore folder, const SchedulerOptions& options)
      : lost(options.lost ? options.lost : EndProcess), guard(options.guard), store(std::move(leading)), artifacts(std::move(folder)) {}

  const std::function<void(const absl::Status&)> lost;
  const rpc::ServerGuard guard;
  std::unique_ptr<store::Store> store;
  /// From the start: a long queue is read before anything is written.
  LeadershipWatch leadership{*store, lost};
  SchedulerMetrics metrics;
  FleetNote fleet;
  storage::ArtifactStore artifacts;
  Engine engine{*store, lost};
  Catalogue catalogue{*store};
  Watchers watchers{catalogue};
  Archive archive{catalogue};
  std::unique_ptr<DiskThreads> disk = std::make_unique<DiskThreads>(kDiskThreads);
  CapturesService captures{engine, catalogue, artifacts, *disk, metrics};
  JobsService jobs{engine, catalogue, watchers, artifacts, *disk, fleet, guard.gate.get()};
  DispatchService dispatch{engine, std::filesystem::absolute(artifacts.root()).lexically_normal().string(), guard.gate.get()};
  ArtifactsService remote_artifacts{engine, *store, artifacts, *disk};
  std::unique_ptr<LookUpThread> look_ups;
  std::unique_ptr<Collector> collector;
  std::unique_ptr<rpc::Server> server;

  absl::Status Restore();
  void StartEngine();
  ~Parts();
};

absl::Status SchedulerServer::Parts::Restore() {
  ASSIGN_OR_RETURN(store::Snapshot snapshot, store->Load());
  spdlog::info("restored: sequences={} jobs={} runs={}", snapshot.sequences.size(), snapshot.jobs.size(), snapshot.runs.size());
  absl::Status status;
  engine.Prepare([&](Turn& turn) { status = catalogue.Restore(turn, std::move(snapshot)); });
  return status;
}

void SchedulerServer::Parts::StartEngine() {
  look_ups = std::make_unique<LookUpThread>(*store, artifacts, [this](std::vector<core::LookUpAnswered> answers) {
    engine.Enqueue([answers = std::move(answers)](Turn& turn) {
      for (const core::LookUpAnswered& answer : answers) turn.Apply(answer);
    });
  });
  engine.Start({.send = [this](core::Message message) { dispatch.Send(std::move(message)); },
                .look_up = [this](std::vector<core::LookUp> asked) { look_ups->Ask(std::move(asked)); },
                .changed =
                    [this](Turn& turn, const std::set<std::string>& changed) {
                      if (catalogue.PlanSome(turn)) engine.Enqueue([](Turn&) {});
                      archive.NoteEnds(turn, changed);
                      watchers.Changed(turn, changed);
                      archive.Changed(turn, changed);
                      metrics.Refresh(turn.state(), engine.waiting(), MonotonicNow());
                    },
                .committed = [this](const std::vector<store::Record>& records, absl::Duration took) { metrics.Committed(records, took); },
                .stalled =
                    [this](const absl::Status& why) {
                      metrics.Stalled();
                      watchers.EndAll(why);
                    }});
}

SchedulerServer::Parts::~Parts() {
  collector.reset();
  if (server) {
    engine.Enqueue([this](Turn& turn) { turn.After([this] { watchers.EndAll(absl::UnavailableError("the scheduler is stopping")); }); });
    dispatch.EndStreams();
    server->Stop(kStopGrace);
    server.reset();
  }
  engine.Stop();
  look_ups.reset();
  disk.reset();
}

SchedulerServer::SchedulerServer(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
SchedulerServer::~SchedulerServer() = default;

void SchedulerServer::DescribeFleet(std::function<std::string()> describe) { parts_->fleet.Set(std::move(describe)); }
const std::shared_ptr<prometheus::Registry>& SchedulerServer::metrics() const { return parts_->metrics.registry(); }

absl::StatusOr<CollectionPlan> SchedulerServer::Collect() { return parts_->collector->Collect(); }

const std::string& SchedulerServer::address() const { return parts_->server->address(); }
const std::string& SchedulerServer::address_here() const { return parts_->server->address_here(); }

absl::StatusOr<fleet::Demand> SchedulerServer::Demand() const {
  const auto promise = std::make_shared<std::promise<fleet::Demand>>();
  std::future<fleet::Demand> demand = promise->get_future();
  RETURN_IF_ERROR(parts_->engine.Ask([promise](Turn& turn) { promise->set_value(DemandOf(turn.state())); }));
  if (demand.wait_for(kDemandPatience) == std::future_status::ready) return demand.get();
  return absl::UnavailableError("the scheduler has been too busy to say what is left to do");
}

absl::StatusOr<std::unique_ptr<SchedulerServer>> SchedulerServer::Start(const SchedulerOptions& options) {
  std::error_code error;
  std::filesystem::create_directories(options.state, error);
  if (error) return absl::UnavailableError(fmt::format("{}: cannot be created: {}", options.state.string(), error.message()));
  ASSIGN_OR_RETURN(std::unique_ptr<store::Store> store, store::OpenSqliteStore(options.state / "scheduler.db"));
  RETURN_IF_ERROR(store->Lead(options.listen).status());
  return Start(options, std::move(store));
}

absl::StatusOr<std::unique_ptr<SchedulerServer>> SchedulerServer::Start(const SchedulerOptions& options, std::unique_ptr<store::Store> store) {
  ASSIGN_OR_RETURN(storage::ArtifactStore artifacts, storage::ArtifactStore::Open(options.state));
  auto parts = std::make_unique<Parts>(std::move(store), std::move(artifacts), options);
  parts->metrics.SetTerm(parts->store->term());
  RETURN_IF_ERROR(parts->Restore());
  parts->StartEngine();
  parts->collector = std::make_unique<Collector>(parts->engine, parts->catalogue, parts->artifacts, parts->metrics, options.collection);
  ASSIGN_OR_RETURN(parts->server, rpc::StartServer({.listen = options.listen,
                                                    .services = {&parts->captures, &parts->jobs, &parts->dispatch, &parts->remote_artifacts},
                                                    .guard = parts->guard}));
  return std::unique_ptr<SchedulerServer>(new SchedulerServer(std::move(parts)));
}

}  // namespace vorocast::server
