// SPDX-License-Identifier: AGPL-3.0-or-later
#include "fake_worker.h"

#include <fstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "absl/time/clock.h"
#include "services/base/digest.h"
#include "services/rpc/channel.h"
#include "services/tasks/task.h"

namespace vorocast::server {
namespace {

std::string Name(const v1::AttemptId& id) { return fmt::format("{}:{}", id.task_id(), id.attempt()); }

}  // namespace

FakeWorker::FakeWorker(std::string scheduler, const storage::ArtifactStore& artifacts, Behaviour behaviour)
    : scheduler_(std::move(scheduler)), artifacts_(artifacts), behaviour_(std::move(behaviour)), thread_([this] { Run(); }) {}

FakeWorker::~FakeWorker() {
  stopping_ = true;
  {
    const std::lock_guard lock(mutex_);
    if (context_) context_->TryCancel();
  }
  thread_.join();
}

std::map<std::string, int> FakeWorker::executed() const {
  const std::lock_guard lock(mutex_);
  return executed_;
}

void FakeWorker::Release() {
  released_ = true;
  const std::lock_guard lock(mutex_);
  if (context_) context_->TryCancel();  // it reports after it has connected again
}

void FakeWorker::Run() {
  while (!stopping_) Serve();
}

void FakeWorker::Serve() {
  const auto stub = v1::Dispatch::NewStub(rpc::Connect(scheduler_));
  grpc::ClientContext context;
  context.set_wait_for_ready(true);
  context.set_deadline(absl::ToChronoTime(absl::Now() + absl::Seconds(60)));
  {
    const std::lock_guard lock(mutex_);
    if (stopping_) return;
    context_ = &context;
  }
  const auto stream = stub->Work(&context);
  v1::WorkerMessage first;
  v1::Hello& hello = *first.mutable_hello();
  hello.set_worker(behaviour_.name);
  hello.set_slots(behaviour_.slots);
  for (const tasks::Kind kind : tasks::kAllKinds) hello.add_kinds(std::string(tasks::Name(kind)));
  {
    const std::lock_guard lock(mutex_);
    if (released_) {
      for (const auto& [name, lease] : held_) unreported_[name] = Execute(lease);
      held_.clear();
    }
    for (const auto& [name, lease] : held_) *hello.add_holding() = lease.id();
    for (const auto& [name, report] : unreported_) *hello.add_holding() = report.id();
  }
  stream->Write(first);
  const auto report = [&](const v1::Finished& finished) {
    v1::WorkerMessage message;
    *message.mutable_finished() = finished;
    stream->Write(message);
  };
  v1::SchedulerMessage message;
  while (stream->Read(&message)) {
    const std::lock_guard lock(mutex_);
    if (message.has_welcome()) {
      went_on_ = message.welcome().go_on_size();
      for (const v1::AttemptId& id : message.welcome().drop()) held_.erase(Name(id)), unreported_.erase(Name(id));
      for (const auto& [name, finished] : unreported_) report(finished);
    }
    for (const v1::Lease& lease : message.leases().leases()) {
      if (!released_ && behaviour_.holds(lease.label())) {
        held_[Name(lease.id())] = lease;
        continue;
      }
      report(unreported_[Name(lease.id())] = Execute(lease));
    }
    for (const v1::AttemptId& id : message.acknowledged().ids()) unreported_.erase(Name(id));
    for (const v1::AttemptId& id : message.revoke().ids()) held_.erase(Name(id));
  }
  const std::lock_guard lock(mutex_);
  context_ = nullptr;
}

v1::Finished FakeWorker::Execute(const v1::Lease& lease) {
  ++executed_[lease.label()];
  v1::Finished finished;
  *finished.mutable_id() = lease.id();
  if (const std::string cause = behaviour_.fails(lease.label()); !cause.empty()) {
    finished.mutable_failed()->set_cause(cause == "CRASHED" ? v1::Failed::CRASHED : v1::Failed::INPUT);
    finished.mutable_failed()->set_message(cause);
    finished.mutable_failed()->set_memory_peak(7 << 20);
    finished.set_log("what " + lease.label() + " printed");
    return finished;
  }
  const auto spec = tasks::TaskSpecFromJson(nlohmann::json::parse(lease.spec_json(), nullptr, false));
  if (!spec.ok() || spec->Key().Hex() != lease.id().task_id()) {
    finished.mutable_failed()->set_cause(v1::Failed::INTERNAL);
    finished.mutable_failed()->set_message("the lease's task does not have the lease's key");
    return finished;
  }
  const std::string_view extension = tasks::Extension(spec->kind);
  const auto temporary = artifacts_.TemporaryPath(extension);
  std::ofstream(temporary) << lease.label();
  const auto sha256 = base::HashFile(temporary);
  if (!sha256.ok() || !artifacts_.PublishArtifact(temporary, spec->Key(), extension).ok()) {
    finished.mutable_failed()->set_cause(v1::Failed::STORE);
    return finished;
  }
  finished.mutable_succeeded()->set_sha256(sha256->Hex());
  finished.mutable_succeeded()->set_size(static_cast<std::int64_t>(lease.label().size()));
  finished.mutable_succeeded()->set_seconds(0.5);
  return finished;
}

}  // namespace vorocast::server
