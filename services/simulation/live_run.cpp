// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/live_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <vector>

#include "services/simulation/effect.h"

namespace vorocast::simulation {
namespace {

constexpr std::size_t kPathMax = 200;
constexpr std::size_t kHistoryBytesMax = 32 << 20;

std::vector<std::string> Split(const std::string& path) {
  std::vector<std::string> names(1);
  for (const char c : path) c == '.' ? (void)names.emplace_back() : names.back().push_back(c);
  return names;
}

/// The element or field of that name, or null.
nlohmann::json* Find(nlohmann::json& json, const std::string& name) {
  if (json.is_object()) {
    const auto found = json.find(name);
    return found == json.end() ? nullptr : &*found;
  }
  if (!json.is_array()) return nullptr;
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), index);
  if (error == std::errc() && end == name.data() + name.size()) return index < json.size() ? &json[index] : nullptr;
  for (nlohmann::json& element : json) {
    if (element.is_object() && element.value("name", nlohmann::json()) == name) return &element;
  }
  return nullptr;
}

absl::StatusOr<nlohmann::json*> Locate(nlohmann::json& effect, const std::string& path) {
  if (path.size() > kPathMax) return absl::InvalidArgumentError(fmt::format("a path has at most {} characters", kPathMax));
  std::vector<std::string> names = Split(path);
  if (!effect.contains(names.front()) && effect.contains("objects") && Find(effect["objects"], names.front()) != nullptr) {
    names.insert(names.begin(), "objects");
  }
  nlohmann::json* at = &effect;
  for (const std::string& name : names) {
    at = Find(*at, name);
    if (at == nullptr) {
      return absl::InvalidArgumentError(
          fmt::format("the effect has no field \"{}\": there is no \"{}\"; docs/effects.md lists the fields of each part", path, name));
    }
  }
  return at;
}

absl::Status CheckLive(const nlohmann::json& canonical) {
  if (canonical.at("morph").is_object()) {
    return absl::InvalidArgumentError(
        "effect: morph: it is made of two whole takes and cannot be shown live; run it as a job, or set it to \"none\"");
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<nlohmann::json> WithField(const nlohmann::json& effect, const std::string& path, const nlohmann::json& value) {
  nlohmann::json changed = effect;
  ASSIGN_OR_RETURN(nlohmann::json * at, Locate(changed, path));
  *at = value;
  return changed;
}

absl::StatusOr<nlohmann::json> FieldOf(const nlohmann::json& effect, const std::string& path) {
  nlohmann::json copy = effect;
  ASSIGN_OR_RETURN(const nlohmann::json* const at, Locate(copy, path));
  return *at;
}

absl::StatusOr<std::unique_ptr<LiveRun>> LiveRun::Open(const geometry::TrackedTake& take, const nlohmann::json& effect) {
  ASSIGN_OR_RETURN(nlohmann::json canonical, NormaliseEffect(effect));
  RETURN_IF_ERROR(CheckLive(canonical));
  std::unique_ptr<LiveRun> live(new LiveRun(take));
  live->first_ = std::move(canonical);
  RETURN_IF_ERROR(live->Restart());
  return live;
}

absl::Status LiveRun::Restart() {
  effect_ = first_;
  ASSIGN_OR_RETURN(run_, EffectRun::Start(take_, effect_));
  return absl::OkStatus();
}

absl::Status LiveRun::Replay() {
  const auto changed = history_.find(frame());
  if (changed == history_.end()) return absl::OkStatus();
  for (const nlohmann::json& effect : changed->second) {
    RETURN_IF_ERROR(run_->Change(effect));
    effect_ = effect;
  }
  return absl::OkStatus();
}

absl::Status LiveRun::Advance(const Cancelled& cancelled) {
  RETURN_IF_ERROR(run_->Advance(cancelled));
  furthest_ = std::max(furthest_, frame());
  return Replay();
}

absl::Status LiveRun::Change(const std::string& path, const nlohmann::json& value) {
  nlohmann::json asked = value;
  if (!path.empty()) {
    ASSIGN_OR_RETURN(asked, WithField(effect_, path, value));
  }
  ASSIGN_OR_RETURN(const nlohmann::json canonical, NormaliseEffect(asked));
  RETURN_IF_ERROR(CheckLive(canonical));
  if (canonical == effect_) return absl::OkStatus();
  const std::size_t bytes = canonical.dump().size();
  if (history_bytes_ + bytes > kHistoryBytesMax) {
    return absl::ResourceExhaustedError("the session has kept as many changes as it can; save what there is and open another one");
  }
  if (frame() == 0) {
    ASSIGN_OR_RETURN(std::unique_ptr<EffectRun> anew, EffectRun::Start(take_, canonical));
    run_ = std::move(anew);
    first_ = canonical;
    history_.clear();
    history_bytes_ = 0;
  } else {
    RETURN_IF_ERROR(run_->Change(canonical));
    history_.erase(history_.upper_bound(frame()), history_.end());
    history_[frame()].push_back(canonical);
    history_bytes_ += bytes;
  }
  effect_ = canonical;
  furthest_ = frame();
  return absl::OkStatus();
}

absl::Status LiveRun::Rewind(std::size_t to, const Cancelled& cancelled) {
  if (to > furthest_) return absl::OutOfRangeError(fmt::format("frame {} has not been computed yet; the furthest is {}", to, furthest_));
  if (to < frame()) RETURN_IF_ERROR(Restart());
  while (frame() < to) RETURN_IF_ERROR(Advance(cancelled));
  return absl::OkStatus();
}

}  // namespace vorocast::simulation
