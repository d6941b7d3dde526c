// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/live_command.h"

#include <stdlib.h>

#include <charconv>
#include <chrono>
#include <cstdio>
#include <limits>
#include <memory>
#include <mutex>
#include <sstream>

#include <fmt/format.h>

#include "services/rpc/channel.h"
#include "services/rpc/server.h"
#include "services/simulation/effect.h"
#include "services/simulation/live_client.h"
#include "services/simulation/live_run.h"
#include "services/simulation/live_sessions.h"
#include "services/storage/hdf5_artifacts.h"

namespace vorocast::simulation {
namespace {

constexpr char kHelp[] =
    "go [N]            plays to the end, or N frames\n"
    "step [N]          plays one frame, or N\n"
    "pause             stops playing\n"
    "rewind N          goes back to frame N (or on to one that was shown before)\n"
    "set FIELD VALUE   changes a field of the effect from this frame on: set recall.stiffness_s2 300, set pendulum.mass_kg 60\n"
    "effect NAME       changes the whole effect: one that ships, or a JSON file\n"
    "show [FIELD]      prints the effect, or a part of it\n"
    "save FILE.h5      writes the frames so far as a simulated.h5\n"
    "quit              ends the session\n";

constexpr auto kConnectTime = std::chrono::seconds(10);

/// A live service of this process's own, for one take.
class OwnService final : public v1::Simulation::WithCallbackMethod_Live<v1::Simulation::Service> {
 public:
  explicit OwnService(std::shared_ptr<const geometry::TrackedTake> take)
      : sessions_({.open_take = [take](const std::string&) { return take; }, .sessions_max = 1, .idle_max = absl::Hours(24 * 365)}) {}
  grpc::ServerBidiReactor<v1::LiveRequest, v1::LiveFrame>* Live(grpc::CallbackServerContext* context) override { return sessions_.Start(context); }

 private:
  LiveSessions sessions_;
};

struct OwnServer {
  std::unique_ptr<OwnService> service;
  std::unique_ptr<rpc::Server> server;
  std::shared_ptr<grpc::Channel> channel;
};

absl::StatusOr<std::shared_ptr<grpc::Channel>> Connected(const std::string& address, const rpc::ClientSecurity& security) {
  ASSIGN_OR_RETURN(std::shared_ptr<grpc::Channel> channel, rpc::Connect(address, security));
  if (!channel->WaitForConnected(std::chrono::system_clock::now() + kConnectTime)) {
    return absl::UnavailableError(fmt::format("{}: no simulation service answers; start one with vorocast-simulation --listen", address));
  }
  return channel;
}

/// Behind a socket in a folder that only this user can enter, and which is gone once we are connected.
absl::StatusOr<OwnServer> StartOwn(std::shared_ptr<const geometry::TrackedTake> take) {
  std::string folder = (std::filesystem::temp_directory_path() / "vorocast-live-XXXXXX").string();
  if (::mkdtemp(folder.data()) == nullptr) return absl::UnavailableError(fmt::format("{}: cannot be made", folder));
  OwnServer own;
  own.service = std::make_unique<OwnService>(std::move(take));
  auto server = rpc::StartServer({.listen = fmt::format("unix:{}/live", folder), .services = {own.service.get()}});
  absl::Status status = server.status();
  if (server.ok()) {
    own.server = *std::move(server);
    auto channel = Connected(own.server->address(), {});
    status = channel.status();
    if (channel.ok()) own.channel = *std::move(channel);
  }
  std::error_code ignored;
  std::filesystem::remove_all(folder, ignored);
  RETURN_IF_ERROR(status);
  return own;
}

std::string Count(std::int64_t count, const char* one) { return fmt::format("{} {}{}", count, one, count == 1 ? "" : "s"); }

/// What comes, as lines; and whether something was refused.
class Screen {
 public:
  void Show(const v1::LiveFrame& frame) {
    switch (frame.what_case()) {
      case v1::LiveFrame::kScene: {
        const v1::LiveScene& scene = frame.scene();
        fmt::print("{}, {} at {:g} a second{}\n", Count(scene.cells(), "cell"), Count(scene.frames(), "frame"), scene.frames_per_second(),
                   scene.objects_size() > 0 ? fmt::format(", {}", fmt::join(scene.objects(), ", ")) : "");
        ShowInstant(frame.frame(), scene.instant());
        break;
      }
      case v1::LiveFrame::kInstant:
        ShowInstant(frame.frame(), frame.instant());
        break;
      case v1::LiveFrame::kRefused: {
        fmt::print(stderr, "refused: {}\n", frame.refused());
        const std::lock_guard lock(mutex_);
        refused_ = frame.refused();
        break;
      }
      case v1::LiveFrame::kEffectJson:
        fmt::print("changed from frame {} on\n", frame.frame());
        break;
      case v1::LiveFrame::WHAT_NOT_SET:
        fmt::print("stands at frame {}\n", frame.frame());
        break;
    }
    std::fflush(stdout);
  }
  bool refused() const {
    const std::lock_guard lock(mutex_);
    return !refused_.empty();
  }

 private:
  static void ShowInstant(std::int32_t frame, const v1::LiveInstant& instant) {
    const std::string cost =
        instant.steps() > 0 ? fmt::format(", {}, {:.2f} ms a step", Count(instant.steps(), "step"), 1e3 * instant.step_seconds()) : "";
    fmt::print("frame {}/{}  {:.3f} s, {} released{}\n", frame, instant.frames() - 1, instant.time(), instant.released(), cost);
  }

  mutable std::mutex mutex_;
  std::string refused_;  // guarded by mutex_
};

absl::StatusOr<std::int32_t> ParseFrame(const std::string& text, const char* command) {
  std::int32_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number < 0) {
    return absl::InvalidArgumentError(fmt::format("{}: \"{}\" is not a number of frames", command, text));
  }
  return number;
}

/// One line of a script. CANCELLED: quit.
class Commands {
 public:
  Commands(LiveClient& client) : client_(client) {}

  absl::Status Execute(const std::string& line) {
    std::istringstream words(line);
    std::string command, first, rest;
    words >> command >> first >> std::ws;
    std::getline(words, rest);
    while (!rest.empty() && (rest.back() == ' ' || rest.back() == '\r')) rest.pop_back();
    if (command.empty() || command.starts_with('#')) return absl::OkStatus();
    if (command == "quit") return absl::CancelledError();
    if (command == "go") return Play(first, 0);
    if (command == "step") return Play(first, 1);
    if (command == "pause") {
      v1::LiveRequest request;
      request.mutable_pause();
      return client_.Ask(request);
    }
    if (command == "rewind") {
      ASSIGN_OR_RETURN(const std::int32_t frame, ParseFrame(first, "rewind"));
      v1::LiveRequest request;
      request.set_rewind(frame);
      return client_.Ask(request);
    }
    if (command == "set") return Set(first, rest);
    if (command == "effect") return ChangeEffect(first);
    if (command == "show") return ShowEffect(first);
    if (command == "save") return Save(first);
    if (command == "help") {
      fmt::print("{}", kHelp);
      std::fflush(stdout);
      return absl::OkStatus();
    }
    return absl::InvalidArgumentError(fmt::format("\"{}\" is no command; help lists them", command));
  }

 private:
  absl::Status Play(const std::string& frames, std::int32_t otherwise) {
    v1::LiveRequest request;
    request.set_play(otherwise);
    if (!frames.empty()) {
      ASSIGN_OR_RETURN(const std::int32_t count, ParseFrame(frames, "go"));
      if (count == 0) return absl::OkStatus();
      request.set_play(count);
    }
    return client_.Ask(request);
  }

  absl::Status Set(const std::string& field, const std::string& value) {
    if (field.empty() || value.empty()) return absl::InvalidArgumentError("set: it takes a field and a value: set recall.stiffness_s2 300");
    v1::LiveRequest request;
    request.mutable_change()->set_path(field);
    // A word needs no quotation marks.
    request.mutable_change()->set_value_json(nlohmann::json::accept(value) ? value : nlohmann::json(value).dump(-1, ' ', true, kReplace));
    return client_.Ask(request);
  }

  absl::Status ChangeEffect(const std::string& name) {
    ASSIGN_OR_RETURN(const nlohmann::json effect, LoadEffect(name));
    v1::LiveRequest request;
    request.mutable_change()->set_value_json(effect.dump());
    return client_.Ask(request);
  }

  absl::Status ShowEffect(const std::string& field) {
    ASSIGN_OR_RETURN(const nlohmann::json effect, ParseJson(client_.effect_json()));
    if (field.empty()) {
      fmt::print("{}\n", effect.dump(2));
    } else {
      ASSIGN_OR_RETURN(const nlohmann::json part, FieldOf(effect, field));
      fmt::print("{}\n", part.dump(2));
    }
    std::fflush(stdout);
    return absl::OkStatus();
  }

  absl::Status Save(const std::string& path) {
    if (path.empty()) return absl::InvalidArgumentError("save: it takes a file's name: save simulated.h5");
    RETURN_IF_ERROR(client_.Save(path));
    fmt::print("{} written to {}\n", Count(static_cast<std::int64_t>(client_.frames()), "frame"), path);
    std::fflush(stdout);
    return absl::OkStatus();
  }

  static constexpr auto kReplace = nlohmann::json::error_handler_t::replace;
  LiveClient& client_;
};

absl::Status WorkOff(LiveClient& client, const Screen& screen, std::istream& input, bool wait) {
  Commands commands(client);
  const auto refused = [&] { return wait && screen.refused() ? absl::InvalidArgumentError("a command was refused") : absl::OkStatus(); };
  RETURN_IF_ERROR(client.AwaitStill());
  for (std::string line; std::getline(input, line);) {
    const absl::Status status = commands.Execute(line);
    if (absl::IsCancelled(status)) return client.Close();
    if (wait) {
      RETURN_IF_ERROR(status);
      RETURN_IF_ERROR(client.AwaitStill());
      RETURN_IF_ERROR(refused());
    } else if (!status.ok()) {
      fmt::print(stderr, "{}\n", std::string(status.message()));
      if (client.over()) return status;
    }
  }
  return client.Close();
}

}  // namespace

absl::Status RunLive(const LiveOptions& options, std::istream& commands, bool wait) {
  ASSIGN_OR_RETURN(const nlohmann::json effect, LoadEffect(options.effect));
  ASSIGN_OR_RETURN(geometry::TrackedTake read, storage::ReadTrackedTake(options.tracked));
  auto take = std::make_shared<const geometry::TrackedTake>(std::move(read));
  OwnServer own;
  LiveClient::Options client_options{.effect = effect, .take = take};
  if (options.at.empty()) {
    ASSIGN_OR_RETURN(own, StartOwn(take));
    client_options.channel = own.channel;
  } else {
    ASSIGN_OR_RETURN(const storage::Provenance provenance, storage::ReadProvenance(options.tracked));
    if (provenance.key.empty()) {
      return absl::FailedPreconditionError(
          fmt::format("{}: it does not tell under which key a service has it; leave --at out to play it here", options.tracked.string()));
    }
    client_options.tracked_key = provenance.key;
    ASSIGN_OR_RETURN(client_options.channel, Connected(options.at, options.security));
  }
  Screen screen;
  client_options.on_frame = [&screen](const v1::LiveFrame& frame) { screen.Show(frame); };
  LiveClient client(std::move(client_options));
  return WorkOff(client, screen, commands, wait);
}

}  // namespace vorocast::simulation
