// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/attempt.h"

#include <signal.h>
#include <string.h>
#include <unistd.h>

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include "services/lease/child_task.h"

namespace vorocast::lease {
namespace {

namespace fs = std::filesystem;

/// A child that dies of an uncaught bad_alloc says so on standard error and aborts.
bool RanOutOfMemory(const ChildEnd& end) { return end.code == SIGABRT && end.printed.find("std::bad_alloc") != std::string::npos; }

std::string SignalName(int signal) {
  const char* name = ::sigabbrev_np(signal);
  return name ? fmt::format("SIG{}", name) : fmt::format("signal {}", signal);
}

std::string CrashMessage(const ChildEnd& end) {
  std::string message = fmt::format("killed by {}", SignalName(end.code));
  if (end.code == SIGKILL) message += " from outside, perhaps because the machine ran out of memory";
  const std::string tail = TailForPeople(end.printed, kMessageBytesMax / 2);
  return tail.empty() ? message : fmt::format("{}; it last wrote: {}", message, tail);
}

/// What an attempt printed goes along, whatever became of it; of most that is nothing.
v1::Finished WithLog(v1::Finished finished, const ChildEnd& end) {
  finished.set_log(TailForPeople(end.printed, kLogBytesMax));
  if (finished.has_failed()) {
    finished.mutable_failed()->set_cpu_seconds(end.cpu_seconds);
    finished.mutable_failed()->set_memory_peak(end.memory_peak);
  }
  return finished;
}

v1::Finished SucceededAttempt(const v1::AttemptId& id, const base::Digest& digest, std::int64_t size, const ChildEnd& end) {
  v1::Finished finished;
  *finished.mutable_id() = id;
  v1::Succeeded& succeeded = *finished.mutable_succeeded();
  succeeded.set_sha256(digest.Hex());
  succeeded.set_size(size);
  succeeded.set_seconds(end.seconds);
  succeeded.set_cpu_seconds(end.cpu_seconds);
  succeeded.set_memory_peak(end.memory_peak);
  return finished;
}

/// Removes the file an attempt wrote, if it is still there.
struct TemporaryFile {
  fs::path path;
  ~TemporaryFile() {
    std::error_code ignored;
    fs::remove(path, ignored);
  }
};

}  // namespace

v1::Failed::Cause CauseOf(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kDataLoss:
    case absl::StatusCode::kFailedPrecondition:
    case absl::StatusCode::kOutOfRange:
      return v1::Failed::INPUT;
    case absl::StatusCode::kResourceExhausted:
      return v1::Failed::OUT_OF_MEMORY;
    // An input is published before its task is leased: where it cannot be found, the folder is not what it should be.
    case absl::StatusCode::kNotFound:
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kPermissionDenied:
      return v1::Failed::STORE;
    default:
      return v1::Failed::INTERNAL;
  }
}

v1::Finished FailedAttempt(const v1::AttemptId& id, v1::Failed::Cause cause, std::string_view message, double seconds) {
  v1::Finished finished;
  *finished.mutable_id() = id;
  finished.mutable_failed()->set_cause(cause);
  finished.mutable_failed()->set_message(TextForPeople(message, kMessageBytesMax));
  finished.mutable_failed()->set_seconds(seconds);
  return finished;
}

Attempt::Attempt(v1::Lease lease, fs::path program, storage::ArtifactStore store, InputCheck& inputs, std::function<void(v1::Finished)> on_end,
                 RemoteArtifacts* remote)
    : lease_(std::move(lease)),
      program_(std::move(program)),
      store_(std::move(store)),
      inputs_(inputs),
      remote_(remote),
      thread_([this, on_end = std::move(on_end)] { on_end(Run()); }) {}

Attempt::~Attempt() {
  Stop();
  thread_.join();
}

v1::Finished Attempt::Fail(v1::Failed::Cause cause, std::string_view message, double seconds) const {
  return FailedAttempt(lease_.id(), cause, message, seconds);
}

/// Bytes that arrive broken again and again are broken where they come from.
v1::Finished Attempt::FailTransfer(const absl::Status& status, double seconds) const {
  if (stop_.stopped()) return Fail(v1::Failed::DRAINED, "stopped before it was done", seconds);
  return Fail(absl::IsDataLoss(status) ? v1::Failed::INPUT : v1::Failed::STORE, std::string(status.message()), seconds);
}

v1::Finished Attempt::Run() {
  const nlohmann::json json = nlohmann::json::parse(lease_.spec_json(), nullptr, false);
  const absl::StatusOr<tasks::TaskSpec> spec = tasks::TaskSpecFromJson(json);
  if (!spec.ok()) return Fail(v1::Failed::INPUT, fmt::format("the task is malformed: {}", std::string(spec.status().message())), 0);
  return RunSpec(*spec);
}

v1::Finished Attempt::RunSpec(const tasks::TaskSpec& spec) {
  // Another attempt, or another job, may have made the result already.
  const std::string_view extension = tasks::Extension(spec.kind);
  if (store_.HasArtifact(spec.Key(), extension)) return Publish(spec, {}, {});

  std::vector<ArtifactCache::Hold> held;
  if (remote_) {
    absl::StatusOr<std::vector<ArtifactCache::Hold>> brought = remote_->Bring(spec, stop_);
    if (!brought.ok()) return FailTransfer(brought.status(), 0);
    held = *std::move(brought);
  }
  if (const absl::Status right = inputs_.Check(spec, store_, remote_ ? InputCheck::Files::kCopies : InputCheck::Files::kStored); !right.ok()) {
    // Damage does not pass: a few attempts, in case only this worker reads it so. What is not there may be a folder that is away.
    const auto cause = absl::IsDataLoss(right) ? v1::Failed::INTERNAL : v1::Failed::STORE;
    return Fail(cause, std::string(right.message()), 0);
  }
  const TemporaryFile output{store_.TemporaryPath(extension)};
  const ChildTask task{spec, store_.root(), output.path, lease_.memory_limit(), ::getpid()};
  ChildCommand command{program_, {"execute-task"}, Encode(task)};
  if (lease_.time_limit_s() > 0) command.time_limit = absl::Seconds(lease_.time_limit_s());
  std::optional<absl::Status> outcome;
  const absl::StatusOr<ChildEnd> end = RunChild(command, stop_, [&](std::string_view line) {
    const ChildLine said = DecodeChildLine(line);
    if (said.progress) fraction_.store(std::clamp(*said.progress, 0.0, 1.0), std::memory_order_relaxed);
    if (said.outcome) outcome = said.outcome;
  });
  if (!end.ok()) return Fail(v1::Failed::INTERNAL, std::string(end.status().message()), 0);
  return WithLog(Judge(spec, output.path, *end, outcome), *end);
}

v1::Finished Attempt::Judge(const tasks::TaskSpec& spec, const fs::path& output, const ChildEnd& child,
                            const std::optional<absl::Status>& outcome) const {
  switch (child.how) {
    case ChildEnd::How::kStopped:
      return Fail(v1::Failed::DRAINED, "stopped before it was done", child.seconds);
    case ChildEnd::How::kTimedOut:
      return Fail(v1::Failed::TIMED_OUT, fmt::format("still running after its limit of {} s", lease_.time_limit_s()), child.seconds);
    case ChildEnd::How::kSignalled:
      if (RanOutOfMemory(child)) {
        return Fail(v1::Failed::OUT_OF_MEMORY, fmt::format("needs more memory than its limit of {} MiB", lease_.memory_limit() >> 20), child.seconds);
      }
      // A cluster that takes its machine back tells every process of a worker at once.
      if (child.code == SIGTERM) return Fail(v1::Failed::DRAINED, "ended by SIGTERM from outside", child.seconds);
      return Fail(v1::Failed::CRASHED, CrashMessage(child), child.seconds);
    case ChildEnd::How::kExited:
      break;
  }
  if (!outcome) {
    const std::string tail = TailForPeople(child.printed, kMessageBytesMax / 2);
    return Fail(v1::Failed::INTERNAL, fmt::format("{} ended with code {} and no outcome; it last wrote: {}", program_.string(), child.code, tail),
                child.seconds);
  }
  if (!outcome->ok()) return Fail(CauseOf(*outcome), std::string(outcome->message()), child.seconds);
  return Publish(spec, output, child);
}

/// Publishes `output` (empty: the result is in place already) and tells what is in place then: of two attempts the first result stays.
v1::Finished Attempt::Publish(const tasks::TaskSpec& spec, const fs::path& output, const ChildEnd& end) const {
  const base::Digest key = spec.Key();
  const std::string_view extension = tasks::Extension(spec.kind);
  if (!output.empty()) {
    const absl::Status published = store_.PublishArtifact(output, key, extension);
    if (!published.ok()) return Fail(v1::Failed::STORE, std::string(published.message()), end.seconds);
  }
  if (remote_) {
    const absl::Status delivered = remote_->Deliver(key, extension, stop_);
    // The result could not be put, whatever the reason: that is the store's failure and not the input's.
    if (!delivered.ok()) return FailTransfer(absl::UnavailableError(delivered.message()), end.seconds);
  }
  const fs::path path = store_.ArtifactPath(key, extension);
  const absl::StatusOr<base::Digest> digest = base::HashFile(path);
  std::error_code error;
  const auto size = static_cast<std::int64_t>(fs::file_size(path, error));
  if (!digest.ok()) return Fail(v1::Failed::STORE, std::string(digest.status().message()), end.seconds);
  if (error) return Fail(v1::Failed::STORE, fmt::format("{}: {}", path.string(), error.message()), end.seconds);
  return SucceededAttempt(lease_.id(), *digest, size, end);
}

}  // namespace vorocast::lease
