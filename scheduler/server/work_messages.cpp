// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/work_messages.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "services/rpc/status.h"

namespace vorocast::server {
namespace {

constexpr std::size_t kWorkerNameMax = 200;
constexpr std::int32_t kSlotsMax = 4096;
constexpr std::size_t kFailureMessageMax = 4000;
/// A worker keeps the last 64 KiB of what an attempt printed; replaced bytes may make that a little longer.
constexpr std::size_t kLogBytesMax = 256 << 10;

absl::StatusOr<core::AttemptId> IdOf(const v1::AttemptId& id) {
  ASSIGN_OR_RETURN(const base::Digest key, rpc::ParseDigest(id.task_id(), "task_id"));
  return core::AttemptId{key, id.attempt()};
}

core::Cause CauseOf(v1::Failed::Cause cause) {
  switch (cause) {
    case v1::Failed::INPUT:
      return core::Cause::kInput;
    case v1::Failed::CRASHED:
      return core::Cause::kCrashed;
    case v1::Failed::OUT_OF_MEMORY:
      return core::Cause::kOutOfMemory;
    case v1::Failed::TIMED_OUT:
      return core::Cause::kTimedOut;
    case v1::Failed::STORE:
      return core::Cause::kStore;
    case v1::Failed::DRAINED:
      return core::Cause::kDrained;
    default:
      return core::Cause::kInternal;
  }
}

/// PostgreSQL's text knows no zero byte.
std::string WithoutZeros(std::string text) {
  std::replace(text.begin(), text.end(), '\0', ' ');
  return text;
}

/// At most `bytes_max` of it, and no character in part: clients could not read a message with such a text at all.
std::string CutText(std::string text, std::size_t bytes_max) {
  if (text.size() <= bytes_max) return text;
  while (bytes_max > 0 && (static_cast<unsigned char>(text[bytes_max]) & 0xC0) == 0x80) --bytes_max;
  text.resize(bytes_max);
  return text;
}

double Measured(double value) { return std::isfinite(value) && value > 0 ? value : 0; }

absl::StatusOr<core::Event> EventOf(core::ConnectionId connection, const v1::Hello& hello) {
  core::WorkerConnected connected{.connection = connection, .worker = hello.worker(), .slots = hello.slots()};
  if (hello.worker().empty() || hello.worker().size() > kWorkerNameMax) {
    return absl::InvalidArgumentError(fmt::format("hello.worker must have 1 to {} characters", kWorkerNameMax));
  }
  if (hello.worker().find('\0') != std::string::npos) return absl::InvalidArgumentError("hello.worker must not have a zero byte");
  if (hello.slots() < 1 || hello.slots() > kSlotsMax) return absl::InvalidArgumentError(fmt::format("hello.slots must be from 1 to {}", kSlotsMax));
  for (const std::string& name : hello.kinds()) {
    ASSIGN_OR_RETURN(const tasks::Kind kind, tasks::KindFromName(name));
    connected.kinds.push_back(kind);
  }
  for (const v1::AttemptId& held : hello.holding()) {
    ASSIGN_OR_RETURN(const core::AttemptId id, IdOf(held));
    connected.holding.push_back(id);
  }
  return connected;
}

absl::StatusOr<core::Event> EventOf(core::ConnectionId connection, const v1::Heartbeat& heartbeat) {
  core::Heartbeat alive{.connection = connection};
  for (const v1::AttemptProgress& progress : heartbeat.progress()) {
    ASSIGN_OR_RETURN(const core::AttemptId id, IdOf(progress.id()));
    alive.progress.push_back({id, Measured(progress.fraction())});
  }
  return alive;
}

absl::StatusOr<core::Event> EventOf(core::ConnectionId connection, const v1::Finished& finished) {
  core::Finished ended{.connection = connection};
  if (finished.log().size() > kLogBytesMax) return absl::InvalidArgumentError(fmt::format("finished.log has more than {} bytes", kLogBytesMax));
  ended.log = finished.log();
  ASSIGN_OR_RETURN(ended.id, IdOf(finished.id()));
  if (finished.has_succeeded()) {
    const v1::Succeeded& succeeded = finished.succeeded();
    core::Result result{.size = std::max<std::int64_t>(succeeded.size(), 0),
                        .seconds = Measured(succeeded.seconds()),
                        .cpu_seconds = Measured(succeeded.cpu_seconds()),
                        .memory_peak = std::max<std::int64_t>(succeeded.memory_peak(), 0)};
    ASSIGN_OR_RETURN(result.sha256, rpc::ParseDigest(succeeded.sha256(), "succeeded.sha256"));
    ended.outcome = core::Succeeded{std::move(result)};
    return ended;
  }
  if (!finished.has_failed()) return absl::InvalidArgumentError("finished has no outcome");
  const v1::Failed& failed = finished.failed();
  ended.outcome = core::AttemptFailed{.cause = CauseOf(failed.cause()),
                                      .message = WithoutZeros(CutText(failed.message(), kFailureMessageMax)),
                                      .seconds = Measured(failed.seconds()),
                                      .cpu_seconds = Measured(failed.cpu_seconds()),
                                      .memory_peak = std::max<std::int64_t>(failed.memory_peak(), 0)};
  return ended;
}

void Fill(const core::AttemptId& id, v1::AttemptId& message) {
  message.set_task_id(id.key.Hex());
  message.set_attempt(id.attempt);
}

struct Writer {
  v1::SchedulerMessage& out;
  const std::string& artifact_root;

  void operator()(const core::Welcome& welcome) const {
    out.mutable_welcome()->set_artifact_root(artifact_root);
    for (const core::AttemptId& id : welcome.go_on) Fill(id, *out.mutable_welcome()->add_go_on());
    for (const core::AttemptId& id : welcome.drop) Fill(id, *out.mutable_welcome()->add_drop());
  }
  void operator()(const core::Leases& leases) const {
    for (const core::Lease& lease : leases.leases) {
      v1::Lease& sent = *out.mutable_leases()->add_leases();
      Fill(lease.id, *sent.mutable_id());
      sent.set_label(lease.label);
      sent.set_spec_json(lease.spec_json);
      sent.set_memory_limit(lease.memory_limit);
      sent.set_time_limit_s(absl::ToDoubleSeconds(lease.time_limit));
    }
  }
  void operator()(const core::Acknowledge& acknowledge) const {
    for (const core::AttemptId& id : acknowledge.ids) Fill(id, *out.mutable_acknowledged()->add_ids());
  }
  void operator()(const core::Revoke& revoke) const {
    for (const core::AttemptId& id : revoke.ids) Fill(id, *out.mutable_revoke()->add_ids());
  }
};

}  // namespace

absl::StatusOr<core::Event> EventOf(core::ConnectionId connection, const v1::WorkerMessage& message) {
  switch (message.message_case()) {
    case v1::WorkerMessage::kHello:
      return EventOf(connection, message.hello());
    case v1::WorkerMessage::kHeartbeat:
      return EventOf(connection, message.heartbeat());
    case v1::WorkerMessage::kFinished:
      return EventOf(connection, message.finished());
    case v1::WorkerMessage::kLeaving:
      return core::WorkerLeaving{connection};
    case v1::WorkerMessage::MESSAGE_NOT_SET:
      break;
  }
  return absl::InvalidArgumentError("an empty message");
}

v1::SchedulerMessage MessageOf(const core::Message& message, const std::string& artifact_root) {
  v1::SchedulerMessage out;
  std::visit(Writer{out, artifact_root}, message.content);
  return out;
}

}  // namespace vorocast::server
