// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/live_client.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "services/rpc/status.h"
#include "services/simulation/effect.h"
#include "services/simulation/effect_run.h"
#include "services/simulation/live_message.h"
#include "services/simulation/persistence.h"
#include "services/storage/hdf5_artifacts.h"

namespace vorocast::simulation {

LiveClient::LiveClient(Options options)
    : options_(std::move(options)), stub_(v1::Simulation::NewStub(options_.channel)), stream_(stub_->Live(&context_)) {
  v1::LiveRequest open;
  open.mutable_open()->set_tracked_key(options_.tracked_key);
  open.mutable_open()->set_effect_json(options_.effect.dump());
  stream_->Write(open);  // should it fail, reading tells why
  reader_ = std::thread([this] { Read(); });
}

LiveClient::~LiveClient() {
  context_.TryCancel();
  reader_.join();
}

void LiveClient::Read() {
  v1::LiveFrame frame;
  absl::Status broken;
  std::int64_t received = 0;
  while (broken.ok() && stream_->Read(&frame)) {
    broken = Keep(frame);
    if (!broken.ok()) break;
    // What comes of it is read on, even where nothing can be sent any more.
    v1::LiveRequest seen;
    seen.set_received(++received);
    {
      const std::lock_guard lock(write_mutex_);
      if (!closed_) stream_->Write(seen);
    }
    if (options_.on_frame) options_.on_frame(frame);
    const std::lock_guard lock(mutex_);
    answered_ = frame.requests();
    paused_ = frame.paused();
    changed_.notify_all();
  }
  if (!broken.ok()) context_.TryCancel();
  const grpc::Status status = stream_->Finish();
  const std::lock_guard lock(mutex_);
  over_ = true;
  end_ = broken.ok() ? rpc::FromGrpc(status) : broken;
  changed_.notify_all();
}

absl::Status LiveClient::KeepInstant(const v1::LiveInstant& instant, std::size_t frame) {
  if (frame > frames_.time.size()) return absl::DataLossError("the service has left out a frame");
  // Going back repeats what is kept already.
  if (frame < frames_.time.size()) return absl::OkStatus();
  return Unpack(instant, options_.take->cell_count(), objects_, frames_);
}

const LiveClient::Change& LiveClient::EffectAt(std::size_t frame) const {
  const auto after = std::ranges::upper_bound(effects_, frame, {}, &Change::frame);
  return *std::prev(after);
}

absl::Status LiveClient::Keep(const v1::LiveFrame& frame) {
  const std::lock_guard lock(mutex_);
  const auto number = static_cast<std::size_t>(std::max(0, frame.frame()));
  at_ = number;
  if (frame.has_scene()) {
    frames_ = {};
    objects_ = static_cast<std::size_t>(frame.scene().objects_size());
    effects_ = {{0, frame.scene().effect_json()}};
    return KeepInstant(frame.scene().instant(), number);
  }
  if (effects_.empty()) return absl::DataLossError("the service did not begin with a scene");
  if (frame.has_instant()) return KeepInstant(frame.instant(), number);
  if (frame.what_case() == v1::LiveFrame::kEffectJson) {
    if (number >= frames_.time.size()) return absl::DataLossError("the service has changed a frame that it did not send");
    if (frame.effect_json() == EffectAt(number).effect_json) return absl::OkStatus();
    // What came later will come again, and differ.
    Truncate(number + 1, options_.take->cell_count(), objects_, frames_);
    std::erase_if(effects_, [&](const Change& change) { return change.frame > number; });
    effects_.push_back({number, frame.effect_json()});
  }
  return absl::OkStatus();
}

absl::Status LiveClient::Ask(v1::LiveRequest request) {
  const std::lock_guard write_lock(write_mutex_);
  {
    const std::lock_guard lock(mutex_);
    if (over_) return end_.ok() ? absl::CancelledError("the session is over") : end_;
    ++asked_;
  }
  // A failed write is told by what is read.
  if (!closed_) stream_->Write(request);
  return absl::OkStatus();
}

absl::Status LiveClient::AwaitStill() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return over_ || (answered_ >= asked_ && paused_); });
  if (!over_) return absl::OkStatus();
  return end_.ok() ? absl::CancelledError("the session is over") : end_;
}

absl::Status LiveClient::Close() {
  {
    const std::lock_guard lock(write_mutex_);
    if (!std::exchange(closed_, true)) stream_->WritesDone();
  }
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return over_; });
  return end_;
}

std::size_t LiveClient::frames() const {
  const std::lock_guard lock(mutex_);
  return frames_.time.size();
}

std::string LiveClient::effect_json() const {
  const std::lock_guard lock(mutex_);
  return effects_.empty() ? "" : EffectAt(at_).effect_json;
}

bool LiveClient::over() const {
  const std::lock_guard lock(mutex_);
  return over_;
}

absl::Status LiveClient::Save(const std::filesystem::path& path) const {
  geometry::SimulatedTake take;
  std::vector<Change> effects;
  {
    const std::lock_guard lock(mutex_);
    take = frames_;
    effects = effects_;
  }
  if (take.time.empty()) return absl::FailedPreconditionError("there is no frame yet");
  ASSIGN_OR_RETURN(const nlohmann::json first, ParseEffect(effects.front().effect_json));
  ASSIGN_OR_RETURN(const nlohmann::json last, ParseEffect(effects.back().effect_json));
  // What does not travel with every frame: the shapes of the objects, and copies, which are made of the whole run.
  ASSIGN_OR_RETURN(const std::unique_ptr<EffectRun> run, EffectRun::Start(*options_.take, first));
  for (const SceneBody& body : run->scene().bodies) take.objects.push_back({body.name, body.mesh});
  ASSIGN_OR_RETURN(const Effect effect, EffectFromCanonicalJson(last));
  RETURN_IF_ERROR(AddCopies(effect.persistence, run->subject(), take));
  take.effect_json = last.dump();
  storage::Provenance provenance{.kind = "simulate", .options_json = last.dump()};
  if (effects.size() > 1) {
    nlohmann::json changes = nlohmann::json::array();
    for (const Change& change : effects) changes.push_back({{"frame", change.frame}, {"effect", nlohmann::json::parse(change.effect_json)}});
    provenance = {.kind = "live", .options_json = nlohmann::json{{"effects", changes}}.dump()};
  }
  return storage::WriteSimulatedTake(path, take, provenance);
}

}  // namespace vorocast::simulation
