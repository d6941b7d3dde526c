// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/live_call.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <exception>
#include <system_error>
#include <thread>

#include <grpcpp/server_context.h>

#include "services/rpc/status.h"
#include "services/simulation/effect.h"
#include "services/simulation/live_message.h"

namespace vorocast::simulation {
namespace {

constexpr std::size_t kRequestsMax = 64;
constexpr std::size_t kWaitingBytesMax = 4 << 20;
constexpr std::int64_t kAhead = 4;

double ThreadSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

LiveCall* LiveCall::Start(LiveSessions& sessions, grpc::CallbackServerContext* context) {
  std::shared_ptr<LiveCall> call(new LiveCall(sessions, context));
  call->self_ = call;
  if (!sessions.Enter()) {
    call->gone_ = true;
    call->Finish(rpc::ToGrpc(absl::ResourceExhaustedError(
        fmt::format("{} live sessions are open, as many as this service takes; try again when one has ended, or raise --live-max",
                    sessions.options_.sessions_max))));
    return call.get();
  }
  call->StartRead(&call->reading_);
  try {
    std::thread([call] { call->Run(); }).detach();
  } catch (const std::system_error& error) {
    sessions.Leaving();
    sessions.Left();
    call->Finish(rpc::ToGrpc(absl::ResourceExhaustedError(fmt::format("no thread for the session: {}; try again later", error.what()))));
  }
  return call.get();
}

void LiveCall::OnReadDone(bool ok) {
  const std::lock_guard lock(mutex_);
  if (!ok) {
    gone_ = true;
    changed_.notify_all();
    return;
  }
  ++heard_;
  // Nobody has received more than was sent.
  received_ = std::clamp(reading_.received(), received_, std::max(received_, sent_));
  if (reading_.what_case() != v1::LiveRequest::WHAT_NOT_SET) {
    waiting_bytes_ += reading_.ByteSizeLong();
    requests_.push_back(std::move(reading_));
  }
  changed_.notify_all();
  read_waits_ = requests_.size() >= kRequestsMax || waiting_bytes_ >= kWaitingBytesMax;
  if (!read_waits_) StartRead(&reading_);
}

void LiveCall::OnWriteDone(bool ok) {
  const std::lock_guard lock(mutex_);
  writing_ = false;
  if (!ok) gone_ = true;
  changed_.notify_all();
}

void LiveCall::OnCancel() {
  const std::lock_guard lock(mutex_);
  gone_ = true;
  changed_.notify_all();
}

void LiveCall::Run() {
  absl::Status status;
  try {
    status = Serve();
  } catch (const std::exception& error) {
    status = absl::InternalError(fmt::format("the session ended: {}", error.what()));
  }
  live_.reset();
  take_.reset();
  {
    std::unique_lock lock(mutex_);
    const auto written = [this] { return !writing_; };
    // A client that takes nothing any more would keep the last message, and with it this thread, for ever.
    const absl::Duration patience = absl::IsDeadlineExceeded(status) ? absl::ZeroDuration() : sessions_.options_.idle_max;
    if (!changed_.wait_for(lock, absl::ToChronoNanoseconds(patience), written)) {
      context_->TryCancel();
      changed_.wait(lock, written);
    }
  }
  // A client that has ended its requests, or gone, has all it wanted.
  if (absl::IsCancelled(status)) status = absl::OkStatus();
  LiveSessions& sessions = sessions_;
  // Before the client learns that the session is over, so that it finds the place free.
  sessions.Leaving();
  Finish(rpc::ToGrpc(status));
  sessions.Left();
}

absl::Status LiveCall::Idle() const {
  return absl::DeadlineExceededError(
      fmt::format("nothing was heard of the client for {}; open another session to go on", absl::FormatDuration(sessions_.options_.idle_max)));
}

absl::Status LiveCall::Send(v1::LiveFrame frame) {
  std::unique_lock lock(mutex_);
  const auto idle = absl::ToChronoNanoseconds(sessions_.options_.idle_max);
  if (!changed_.wait_for(lock, idle, [this] { return !writing_ || gone_; })) return Idle();
  if (gone_) return Gone();
  written_ = std::move(frame);
  written_.set_requests(answered_);
  if (live_) written_.set_frame(static_cast<std::int32_t>(live_->frame()));
  written_.set_paused(!playing());
  writing_ = true;
  ++sent_;
  StartWrite(&written_);
  return absl::OkStatus();
}

absl::StatusOr<std::optional<v1::LiveRequest>> LiveCall::Next() {
  std::unique_lock lock(mutex_);
  const auto idle = absl::ToChronoNanoseconds(sessions_.options_.idle_max);
  const auto ready = [this] { return gone_ || !requests_.empty() || (playing() && !writing_ && sent_ - received_ < kAhead); };
  while (!ready()) {
    const std::uint64_t heard = heard_;
    if (!changed_.wait_for(lock, idle, [&] { return ready() || heard_ != heard; })) return Idle();
  }
  if (gone_) return Gone();
  if (requests_.empty()) return std::optional<v1::LiveRequest>();
  v1::LiveRequest request = std::move(requests_.front());
  requests_.pop_front();
  waiting_bytes_ -= request.ByteSizeLong();
  if (read_waits_) {
    read_waits_ = false;
    StartRead(&reading_);
  }
  return std::optional(std::move(request));
}

absl::Status LiveCall::Serve() {
  while (true) {
    ASSIGN_OR_RETURN(const std::optional<v1::LiveRequest> request, Next());
    if (!request) {
      RETURN_IF_ERROR(PlayOne());
    } else if (!live_) {
      RETURN_IF_ERROR(Open(*request));
    } else {
      RETURN_IF_ERROR(Answer(*request));
    }
  }
}

absl::Status LiveCall::Open(const v1::LiveRequest& request) {
  if (!request.has_open()) return absl::InvalidArgumentError("the first message of a live session has to open a take");
  ASSIGN_OR_RETURN(const nlohmann::json effect, ParseEffect(request.open().effect_json()));
  ASSIGN_OR_RETURN(take_, sessions_.options_.open_take(request.open().tracked_key()));
  ASSIGN_OR_RETURN(live_, LiveRun::Open(*take_, effect));
  ++answered_;
  return SendScene();
}

absl::Status LiveCall::SendScene() {
  v1::LiveFrame frame;
  v1::LiveScene& scene = *frame.mutable_scene();
  scene.set_cells(static_cast<std::int32_t>(take_->cell_count()));
  scene.set_frames(static_cast<std::int32_t>(live_->run().instants()));
  scene.set_frames_per_second(1 / live_->run().frame_time());
  for (const SceneBody& body : live_->run().scene().bodies) scene.add_objects(body.name);
  scene.set_effect_json(live_->effect().dump());
  Fill(*scene.mutable_instant());
  return Send(std::move(frame));
}

absl::Status LiveCall::Refuse(const absl::Status& why) {
  v1::LiveFrame frame;
  frame.set_refused(std::string(why.message()));
  return Send(std::move(frame));
}

absl::Status LiveCall::Answer(const v1::LiveRequest& request) {
  ++answered_;
  switch (request.what_case()) {
    case v1::LiveRequest::kPlay:
      if (request.play() < 0) return Refuse(absl::InvalidArgumentError(fmt::format("play: {} frames; it must be 0 or more", request.play())));
      to_play_ = live_->at_end() ? 0 : request.play() == 0 ? -1 : request.play();
      return playing() ? absl::OkStatus() : Send({});
    case v1::LiveRequest::kPause:
      to_play_ = 0;
      return Send({});
    case v1::LiveRequest::kChange: {
      const auto value = ParseJson(request.change().value_json());
      if (!value.ok()) return Refuse(base::Annotate(value.status(), "value_json"));
      if (const absl::Status status = live_->Change(request.change().path(), *value); !status.ok()) return Refuse(status);
      if (live_->frame() == 0) return SendScene();
      v1::LiveFrame frame;
      frame.set_effect_json(live_->effect().dump());
      return Send(std::move(frame));
    }
    case v1::LiveRequest::kRewind: {
      to_play_ = 0;
      if (request.rewind() < 0) return Refuse(absl::InvalidArgumentError("rewind: a frame's number is 0 or more"));
      const absl::Status status = live_->Rewind(static_cast<std::size_t>(request.rewind()), [this] { return gone_.load(); });
      if (absl::IsOutOfRange(status)) return Refuse(status);
      RETURN_IF_ERROR(status);
      return SendInstant(0, 0);
    }
    default:
      return Refuse(absl::InvalidArgumentError("the session is open already"));
  }
}

absl::Status LiveCall::PlayOne() {
  const std::int64_t before = live_->run().step_count();
  const double started = ThreadSeconds();
  if (to_play_ > 0) --to_play_;
  RETURN_IF_ERROR(live_->Advance([this] { return gone_.load(); }));
  if (live_->at_end()) to_play_ = 0;
  return SendInstant(static_cast<int>(live_->run().step_count() - before), ThreadSeconds() - started);
}

absl::Status LiveCall::SendInstant(int steps, double seconds) {
  v1::LiveFrame frame;
  v1::LiveInstant& instant = *frame.mutable_instant();
  Fill(instant);
  instant.set_steps(steps);
  instant.set_step_seconds(seconds / std::max(1, steps));
  return Send(std::move(frame));
}

void LiveCall::Fill(v1::LiveInstant& instant) const {
  geometry::SimulatedTake now;
  live_->run().Record(now);
  Pack(now, instant);
  instant.set_frames(static_cast<std::int32_t>(live_->run().instants()));
}

}  // namespace vorocast::simulation
