// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/lease_loop.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include "services/lease/attempt.h"
#include "services/lease/dispatch_stream.h"
#include "services/lease/drain_signals.h"
#include "services/lease/event_queue.h"
#include "services/lease/input_check.h"
#include "services/lease/lease_metrics.h"
#include "services/lease/remote_artifacts.h"
#include "services/rpc/channel.h"

namespace vorocast::lease {
namespace {

using Steady = std::chrono::steady_clock;

constexpr absl::Duration kReconnectFirst = absl::Milliseconds(50);
constexpr absl::Duration kReconnectLast = absl::Seconds(1);
/// A connection that has not been welcomed by then is given up.
constexpr absl::Duration kWelcomeTime = absl::Seconds(10);
/// The same where there is another scheduler to try.
constexpr absl::Duration kWelcomeTimeOfSeveral = absl::Seconds(3);
constexpr absl::Duration kReconnectLastOfSeveral = absl::Milliseconds(200);
/// How long a leaving worker waits for its last reports to be acknowledged.
constexpr absl::Duration kFarewellTime = absl::Seconds(5);
/// How long it waits for the scheduler to end the stream after that.
constexpr absl::Duration kGoodbyeTime = absl::Seconds(1);
/// Files younger than this are not taken for leftovers.
constexpr absl::Duration kLeftoverAge = absl::Minutes(10);

/// Orders attempts, so that everything sent has a fixed order.
using AttemptKey = std::pair<std::string, std::int64_t>;
AttemptKey KeyOf(const v1::AttemptId& id) { return {id.task_id(), id.attempt()}; }
v1::AttemptId IdOf(const AttemptKey& key) {
  v1::AttemptId id;
  id.set_task_id(key.first);
  id.set_attempt(key.second);
  return id;
}

std::string DefaultName() {
  char host[256] = {};
  if (::gethostname(host, sizeof(host) - 1) != 0) host[0] = '?';
  return fmt::format("{}-{}-{}", host, ::getpid(), absl::ToUnixMillis(absl::Now()));
}

/// A point in time that may lie in the future; never in the past of a clock that jumps.
class Deadline {
 public:
  void Set(absl::Duration from_now) { at_ = Steady::now() + absl::ToChronoNanoseconds(from_now); }
  void Clear() { at_.reset(); }
  bool set() const { return at_.has_value(); }
  bool passed() const { return at_ && Steady::now() >= *at_; }
  absl::Duration left() const { return at_ ? std::max(absl::ZeroDuration(), absl::FromChrono(*at_ - Steady::now())) : absl::InfiniteDuration(); }

 private:
  std::optional<Steady::time_point> at_;
};

/// All state belongs to the thread that calls Run; streams, attempts and signals only push events.
///
/// A lease is in one of three places: waiting_ (no free slot yet), running_, or reports_ (ended, not yet acknowledged). The worker holds all of them.
class LeaseLoop {
 public:
  LeaseLoop(const LeaseLoopOptions& options, const std::vector<tasks::Kind>& kinds)
      : options_(options), name_(options.name.empty() ? DefaultName() : options.name), kinds_(kinds) {}

  absl::Status Run() {
    for (const std::string& address : rpc::SplitAddresses(options_.scheduler)) {
      ASSIGN_OR_RETURN(const std::shared_ptr<grpc::Channel> channel, rpc::Connect(address, options_.security));
      schedulers_.push_back({address, v1::Dispatch::NewStub(channel)});
    }
    if (options_.artifacts_remote) RETURN_IF_ERROR(OpenCache());
    const DrainSignals signals([this] { events_.Push(DrainRequested{}); });
    reconnect_.Set(absl::ZeroDuration());
    NoteAway();
    heartbeat_.Set(options_.heartbeat);
    while (!IsOver()) {
      RunTimers();
      if (std::optional<Event> event = events_.Pop(NextTimer())) {
        std::visit([this](auto& e) { On(e); }, *event);
        if (options_.metrics) options_.metrics->SetBusy(running_.size());
      }
    }
    return SayFarewell();
  }
  const LeaseLoopSummary& summary() const { return summary_; }

 private:
  // Timers.

  absl::Duration NextTimer() const {
    return std::min({reconnect_.left(), welcome_.left(), away_.left(), heartbeat_.left(), drain_.left(), farewell_.left()});
  }

  void RunTimers() {
    if (reconnect_.passed()) ConnectAgain();
    if (welcome_.passed()) EndStream("no welcome");
    if (heartbeat_.passed()) SendHeartbeat();
    if (away_.passed()) {
      away_.Clear();
      Log(fmt::format("the scheduler has been away: time={}", absl::FormatDuration(options_.leave_after)));
      if (!draining_) Drain();
    }
    if (drain_.passed()) {
      drain_.Clear();
      for (auto& [key, attempt] : running_) attempt->Stop();
    }
  }

  // The connection.

  void ConnectAgain() {
    reconnect_.Clear();
    // The first call fails when the connection does, so that a wrong certificate is told and not waited out; later ones wait for the scheduler.
    const bool only_one = schedulers_.size() == 1;
    welcome_.Set(only_one ? kWelcomeTime : kWelcomeTimeOfSeveral);
    v1::Hello hello;
    hello.set_worker(name_);
    hello.set_slots(options_.slots);
    for (const tasks::Kind kind : kinds_) hello.add_kinds(std::string(tasks::Name(kind)));
    for (const auto& [key, lease] : waiting_) *hello.add_holding() = IdOf(key);
    for (const auto& [key, attempt] : running_) {
      if (!dropped_.contains(key)) *hello.add_holding() = IdOf(key);
    }
    for (const auto& [key, report] : reports_) *hello.add_holding() = IdOf(key);
    stream_ = std::make_unique<DispatchStream>(*scheduler().stub, ++stream_number_, std::move(hello), events_, only_one && lost_);
  }

  void NoteAway() {
    if (!away_.set() && options_.leave_after != absl::InfiniteDuration()) away_.Set(options_.leave_after);
  }

  void EndStream(const std::string& why) {
    NoteAway();
    if (welcomed_ || !lost_)
      Log(fmt::format("lost the scheduler, trying again until it is back: scheduler={} reason=\"{}\"", scheduler().address, why));
    lost_ = true;
    welcomed_ = false;
    if (options_.metrics) options_.metrics->SetConnected(false);
    welcome_.Clear();
    stream_.reset();
    reconnect_.Set(backoff_);
    backoff_ = std::min(2 * backoff_, schedulers_.size() == 1 ? kReconnectLast : kReconnectLastOfSeveral);
    scheduler_ = (scheduler_ + 1) % schedulers_.size();
  }

  void Send(const v1::WorkerMessage& message) {
    if (welcomed_) stream_->Send(message);
  }

  void On(StreamEnded& event) {
    if (stream_ && event.stream == stream_->number()) EndStream(event.why);
  }

  void On(StreamMessage& event) {
    if (!stream_ || event.stream != stream_->number()) return;
    v1::SchedulerMessage& message = event.message;
    if (message.has_welcome()) OnWelcome(message.welcome());
    if (message.has_leases()) {
      for (v1::Lease& lease : *message.mutable_leases()->mutable_leases()) TakeLease(std::move(lease));
      StartWaiting();
      SendHeartbeat();
    }
    if (message.has_acknowledged()) {
      for (const v1::AttemptId& id : message.acknowledged().ids()) reports_.erase(KeyOf(id));
    }
    if (message.has_revoke()) {
      for (const v1::AttemptId& id : message.revoke().ids()) Drop(id);
    }
  }

  void OnWelcome(const v1::Welcome& welcome) {
    welcomed_ = true;
    if (options_.metrics) options_.metrics->SetConnected(true);
    welcome_.Clear();
    away_.Clear();
    lost_ = false;
    backoff_ = kReconnectFirst;
    if (!remote_) OpenStore(welcome.artifact_root());
    Log(fmt::format("takes tasks: scheduler={} slots={} results=\"{}\"", scheduler().address, options_.slots,
                    remote_ ? "to it, by way of " + options_.cache.string() : welcome.artifact_root()));
    for (const v1::AttemptId& id : welcome.drop()) Drop(id);
    for (const auto& [key, report] : reports_) SendReport(report);
    if (draining_) SendLeaving();
    SendHeartbeat();
  }

  absl::Status OpenCache() {
    ASSIGN_OR_RETURN(
        remote_, RemoteArtifacts::Open(
                     {.scheduler = options_.scheduler, .security = options_.security, .cache = options_.cache, .cache_limit = options_.cache_limit}));
    store_ = remote_->store();
    store_->RemoveStaleTemporaries(kLeftoverAge);
    return absl::OkStatus();
  }

  void OpenStore(const std::string& root) {
    if (store_.ok() && store_->root() == root) return;
    store_ = storage::ArtifactStore::Open(root);
    if (!store_.ok()) return Log(fmt::format("the artifact folder cannot be used: error=\"{}\"", std::string(store_.status().message())));
    store_->RemoveStaleTemporaries(kLeftoverAge);
  }

  // Leases.

  void TakeLease(v1::Lease lease) {
    const AttemptKey key = KeyOf(lease.id());
    if (waiting_.contains(key) || running_.contains(key)) return;
    if (const auto report = reports_.find(key); report != reports_.end()) return SendReport(report->second);
    if (draining_) return Conclude(FailedAttempt(lease.id(), v1::Failed::DRAINED, "the worker is leaving", 0));
    waiting_.emplace(key, std::move(lease));
  }

  void StartWaiting() {
    while (!waiting_.empty() && std::cmp_less(running_.size(), options_.slots)) {
      auto [key, lease] = std::move(*waiting_.begin());
      waiting_.erase(waiting_.begin());
      if (!store_.ok()) {
        Conclude(FailedAttempt(lease.id(), v1::Failed::STORE, std::string(store_.status().message()), 0));
        continue;
      }
      running_.emplace(key, std::make_unique<Attempt>(
                                std::move(lease), options_.program, *store_, inputs_,
                                [this](v1::Finished finished) { events_.Push(AttemptEnded{std::move(finished)}); }, remote_.get()));
    }
  }

  /// The result is not wanted any more. A running attempt's end is still waited for: its slot is not free before.
  void Drop(const v1::AttemptId& id) {
    const AttemptKey key = KeyOf(id);
    waiting_.erase(key);
    reports_.erase(key);
    if (const auto attempt = running_.find(key); attempt != running_.end() && dropped_.insert(key).second) attempt->second->Stop();
  }

  void On(AttemptEnded& event) {
    const AttemptKey key = KeyOf(event.finished.id());
    const auto attempt = running_.find(key);
    if (attempt == running_.end()) return;
    const bool wanted = dropped_.erase(key) == 0;
    if (wanted) LogEnd(attempt->second->lease(), event.finished);
    if (wanted && options_.metrics) options_.metrics->AttemptEnded(event.finished);
    running_.erase(attempt);
    if (wanted) Conclude(std::move(event.finished));
    StartWaiting();
  }

  void LogEnd(const v1::Lease& lease, const v1::Finished& finished) const {
    if (finished.has_failed()) {
      spdlog::warn("attempt failed: task=\"{}\" attempt={} worker={} cause={} message=\"{}\"", lease.label(), lease.id().attempt(), name_,
                   v1::Failed::Cause_Name(finished.failed().cause()), finished.failed().message());
    } else {
      spdlog::info("attempt done: task=\"{}\" attempt={} worker={} seconds={:.2f}", lease.label(), lease.id().attempt(), name_,
                   finished.succeeded().seconds());
    }
  }

  void Conclude(v1::Finished finished) {
    if (finished.failed().cause() == v1::Failed::DRAINED) ++summary_.given_back;
    const AttemptKey key = KeyOf(finished.id());
    SendReport(reports_.insert_or_assign(key, std::move(finished)).first->second);
  }

  void SendReport(const v1::Finished& report) {
    v1::WorkerMessage message;
    *message.mutable_finished() = report;
    Send(message);
  }

  void SendHeartbeat() {
    heartbeat_.Set(options_.heartbeat);
    v1::WorkerMessage message;
    v1::Heartbeat& heartbeat = *message.mutable_heartbeat();
    for (const auto& [key, lease] : waiting_) *heartbeat.add_progress()->mutable_id() = lease.id();
    for (const auto& [key, attempt] : running_) {
      if (dropped_.contains(key)) continue;
      v1::AttemptProgress& progress = *heartbeat.add_progress();
      *progress.mutable_id() = attempt->lease().id();
      progress.set_fraction(attempt->fraction());
    }
    Send(message);
  }

  // Leaving.

  void On(DrainRequested&) {
    summary_.told_to_stop = true;
    if (draining_) {
      // Asked again: stop now.
      drain_.Set(absl::ZeroDuration());
    } else {
      Drain();
    }
  }

  void Drain() {
    draining_ = true;
    drain_.Set(options_.drain_time);
    farewell_.Set(options_.drain_time + kFarewellTime);
    Log(fmt::format("leaving: running={} drain_time={}", running_.size(), absl::FormatDuration(options_.drain_time)));
    if (welcomed_) SendLeaving();
    for (const auto& [key, lease] : std::exchange(waiting_, {})) Conclude(FailedAttempt(lease.id(), v1::Failed::DRAINED, "the worker is leaving", 0));
  }

  void SendLeaving() {
    v1::WorkerMessage message;
    message.mutable_leaving();
    Send(message);
  }

  bool IsOver() const { return draining_ && waiting_.empty() && running_.empty() && (reports_.empty() || farewell_.passed()); }

  absl::Status SayFarewell() {
    if (welcomed_) {
      stream_->CloseSending();
      // The scheduler ends the stream in turn; cancelling it before could take back what was sent last.
      Deadline patience;
      patience.Set(kGoodbyeTime);
      while (!patience.passed()) {
        const std::optional<Event> event = events_.Pop(patience.left());
        if (event && std::holds_alternative<StreamEnded>(*event)) break;
      }
    }
    stream_.reset();
    if (reports_.empty()) return absl::OkStatus();
    return absl::UnavailableError(fmt::format("left with {} reports that the scheduler at {} did not take; it will have those tasks run again",
                                              reports_.size(), options_.scheduler));
  }

  /// `what` ends with at least one field.
  void Log(const std::string& what) const { spdlog::info("{} worker={}", what, name_); }

  const LeaseLoopOptions options_;
  const std::string name_;
  const std::vector<tasks::Kind> kinds_;
  struct Scheduler {
    std::string address;
    std::unique_ptr<v1::Dispatch::Stub> stub;
  };
  const Scheduler& scheduler() const { return schedulers_[scheduler_]; }
  std::vector<Scheduler> schedulers_;
  std::size_t scheduler_ = 0;  // the one in use
  EventQueue events_;          // outlives everything below, which pushes to it

  InputCheck inputs_;  // the attempts use it
  absl::StatusOr<storage::ArtifactStore> store_ = absl::UnavailableError("the scheduler has not said yet where the artifact folder is");
  std::unique_ptr<RemoteArtifacts> remote_;  // outlives the attempts
  std::map<AttemptKey, v1::Lease> waiting_;
  std::map<AttemptKey, std::unique_ptr<Attempt>> running_;
  std::set<AttemptKey> dropped_;  // of running_: stopped because nobody wants the result
  std::map<AttemptKey, v1::Finished> reports_;

  std::unique_ptr<DispatchStream> stream_;
  std::uint64_t stream_number_ = 0;
  bool welcomed_ = false;
  bool lost_ = false;  // said so already
  bool draining_ = false;
  LeaseLoopSummary summary_;
  absl::Duration backoff_ = kReconnectFirst;
  Deadline reconnect_, welcome_, away_, heartbeat_, drain_, farewell_;
};

absl::Status Validate(const LeaseLoopOptions& options) {
  if (options.scheduler.empty()) return absl::InvalidArgumentError("the scheduler's address is missing; give host:port or unix:/path");
  if (options.slots < 1 || options.slots > kSlotsMax) return absl::InvalidArgumentError(fmt::format("slots must be from 1 to {}", kSlotsMax));
  if (options.name.size() > kNameMax) return absl::InvalidArgumentError(fmt::format("a worker's name has at most {} characters", kNameMax));
  if (::access(options.program.c_str(), X_OK) != 0) {
    return absl::InvalidArgumentError(fmt::format("{} cannot be executed; tasks run in it", options.program.string()));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status RunLeaseLoop(const LeaseLoopOptions& options, const std::vector<tasks::Kind>& kinds, LeaseLoopSummary* summary) {
  RETURN_IF_ERROR(Validate(options));
  LeaseLoop loop(options, kinds);
  const absl::Status status = loop.Run();
  if (summary) *summary = loop.summary();
  return status;
}

}  // namespace vorocast::lease
