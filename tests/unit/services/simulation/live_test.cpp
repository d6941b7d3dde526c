// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <fmt/format.h>
#include "absl/time/clock.h"
#include "services/base/digest.h"
#include "services/lease/child_process.h"
#include "services/rpc/server.h"
#include "services/simulation/effect.h"
#include "services/simulation/live_client.h"
#include "services/simulation/live_message.h"
#include "services/simulation/live_run.h"
#include "services/simulation/live_sessions.h"
#include "services/simulation/simulate.h"
#include "services/storage/hdf5_artifacts.h"
#include "tests/unit/services/simulation/synthetic_take.h"

namespace vorocast::simulation {
namespace {

using geometry::SimulatedTake;
using geometry::TrackedTake;
using nlohmann::json;
using ::testing::HasSubstr;

const json kFalling = {{"name", "falling"}, {"duration_s", 1}, {"release", {{{"by", "height"}, {"end_s", 0.6}}}}};
const json kStruck = {{"name", "struck"},
                      {"duration_s", 1},
                      {"rupture", {{"acceleration_m_s2", 60}}},
                      {"objects", {{{"kind", "sphere"}, {"name", "ball"}, {"position_m", {0.0, 0.6, 0.0}}, {"radius_m", 0.06}, {"mass_kg", 20}}}}};

class OnlyLive final : public v1::Simulation::WithCallbackMethod_Live<v1::Simulation::Service> {
 public:
  explicit OnlyLive(LiveSessions::Options options) : sessions_(std::move(options)) {}
  grpc::ServerBidiReactor<v1::LiveRequest, v1::LiveFrame>* Live(grpc::CallbackServerContext* context) override { return sessions_.Start(context); }

 private:
  LiveSessions sessions_;
};

/// The frames that a session sent, the last of each number.
class Seen {
 public:
  std::function<void(const v1::LiveFrame&)> Listener() {
    return [this](const v1::LiveFrame& frame) {
      const std::lock_guard lock(mutex_);
      if (frame.has_scene()) instants_.clear();
      if (frame.has_scene()) instants_[0] = Comparable(frame.scene().instant());
      if (frame.has_instant()) instants_[frame.frame()] = Comparable(frame.instant());
      if (frame.what_case() == v1::LiveFrame::kRefused) refused_.push_back(frame.refused());
      if (frame.has_scene()) scenes_.push_back(frame.scene());
    };
  }
  std::map<int, std::string> instants() const {
    const std::lock_guard lock(mutex_);
    return instants_;
  }
  std::vector<std::string> refused() const {
    const std::lock_guard lock(mutex_);
    return refused_;
  }
  std::vector<v1::LiveScene> scenes() const {
    const std::lock_guard lock(mutex_);
    return scenes_;
  }

 private:
  /// Without what the session's processor had to do with it, and how far away the frame before was.
  static std::string Comparable(v1::LiveInstant instant) {
    instant.clear_step_seconds();
    instant.clear_steps();
    return instant.SerializeAsString();
  }
  mutable std::mutex mutex_;
  std::map<int, std::string> instants_;
  std::vector<std::string> refused_;
  std::vector<v1::LiveScene> scenes_;
};

class LiveTest : public ::testing::Test {
 protected:
  void SetUp() override {
    root_ = std::filesystem::path(::testing::TempDir()) /
            fmt::format("vorocast_live_{}", ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::remove_all(root_);
    std::filesystem::create_directories(root_);
    take_ = std::make_shared<const TrackedTake>(testing::Animate(testing::CubeBlock(3, 4, 3, 0.05, 0.2), 10, 25, testing::Sway));
    Serve({});
  }
  void TearDown() override {
    server_.reset();
    std::filesystem::remove_all(root_);
  }

  struct Limits {
    std::int32_t sessions_max = 4;
    absl::Duration idle_max = absl::Minutes(10);
  };
  void Serve(const Limits& limits) {
    server_.reset();
    service_ = std::make_unique<OnlyLive>(LiveSessions::Options{
        .open_take = [this](const std::string& key) { return OpenTake(key); }, .sessions_max = limits.sessions_max, .idle_max = limits.idle_max});
    auto server = rpc::StartServer({.services = {service_.get()}});
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    channel_ = grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials());
    stub_ = v1::Simulation::NewStub(channel_);
  }
  absl::StatusOr<std::shared_ptr<const TrackedTake>> OpenTake(const std::string& key) const {
    if (key != "take") return absl::NotFoundError("no such take");
    return take_;
  }

  std::unique_ptr<LiveClient> Open(const json& effect, Seen& seen) const {
    return std::make_unique<LiveClient>(
        LiveClient::Options{.channel = channel_, .tracked_key = "take", .effect = effect, .take = take_, .on_frame = seen.Listener()});
  }
  static absl::Status Play(LiveClient& client, std::int32_t frames) {
    v1::LiveRequest request;
    request.set_play(frames);
    if (const absl::Status status = client.Ask(request); !status.ok()) return status;
    return client.AwaitStill();
  }
  static absl::Status Rewind(LiveClient& client, std::int32_t frame) {
    v1::LiveRequest request;
    request.set_rewind(frame);
    if (const absl::Status status = client.Ask(request); !status.ok()) return status;
    return client.AwaitStill();
  }
  static absl::Status Change(LiveClient& client, const std::string& path, const std::string& value) {
    v1::LiveRequest request;
    request.mutable_change()->set_path(path);
    request.mutable_change()->set_value_json(value);
    if (const absl::Status status = client.Ask(request); !status.ok()) return status;
    return client.AwaitStill();
  }
  SimulatedTake Batch(const json& effect) const {
    auto result = Simulate(*take_, effect, {});
    EXPECT_TRUE(result.ok()) << result.status();
    return result.ok() ? *std::move(result) : SimulatedTake{};
  }
  /// The instant of a batch run as it would travel.
  std::string BatchInstant(const SimulatedTake& batch, std::size_t s, double frames) const {
    const std::size_t n = take_->cell_count();
    const std::size_t objects = batch.objects.size();
    SimulatedTake one;
    const auto part = [s](const auto& all, std::size_t count, auto& to) {
      to.assign(all.begin() + static_cast<std::ptrdiff_t>(s * count), all.begin() + static_cast<std::ptrdiff_t>((s + 1) * count));
    };
    part(batch.time, 1, one.time);
    part(batch.cell_rotation, n, one.cell_rotation);
    part(batch.cell_translation, n, one.cell_translation);
    part(batch.cell_state, n, one.cell_state);
    part(batch.object_pose, objects, one.object_pose);
    v1::LiveInstant instant;
    Pack(one, instant);
    instant.set_frames(static_cast<std::int32_t>(frames));
    return instant.SerializeAsString();
  }
  static std::string WithoutDepths(const std::string& bytes) {
    v1::LiveInstant instant;
    EXPECT_TRUE(instant.ParseFromString(bytes));
    instant.clear_cell_penetration_m();
    instant.clear_cell_overlap_m();
    instant.clear_object_penetration_m();
    instant.clear_ground_penetration_m();
    return instant.SerializeAsString();
  }
  void ExpectBatch(const std::map<int, std::string>& instants, const json& effect) const {
    const SimulatedTake batch = Batch(effect);
    ASSERT_EQ(instants.size(), batch.time.size());
    for (std::size_t s = 0; s < batch.time.size(); ++s) {
      EXPECT_EQ(WithoutDepths(instants.at(static_cast<int>(s))), BatchInstant(batch, s, static_cast<double>(batch.time.size()))) << "frame " << s;
    }
  }

  std::filesystem::path root_;
  std::shared_ptr<const TrackedTake> take_;
  std::unique_ptr<OnlyLive> service_;
  std::unique_ptr<rpc::Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::Simulation::Stub> stub_;
};

TEST_F(LiveTest, FramesAreThoseOfTheBatchRun) {
  for (const json& effect : {kFalling, kStruck}) {
    Seen seen;
    const auto client = Open(effect, seen);
    ASSERT_TRUE(Play(*client, 3).ok());
    EXPECT_EQ(seen.instants().size(), 4U);
    ASSERT_TRUE(Play(*client, 0).ok());
    ExpectBatch(seen.instants(), effect);
    // At the end there is nothing more to play, and that is an answer too.
    EXPECT_TRUE(Play(*client, 1).ok());
    EXPECT_TRUE(client->Close().ok());
  }
}

TEST_F(LiveTest, WhatIsSavedIsTheBatchRunsFile) {
  Seen seen;
  const auto client = Open(kStruck, seen);
  ASSERT_TRUE(Play(*client, 0).ok());
  const absl::Status saved = client->Save(root_ / "live.h5");
  ASSERT_TRUE(saved.ok()) << saved;
  ASSERT_TRUE(
      storage::WriteSimulatedTake(root_ / "batch.h5", Batch(kStruck), {.kind = "simulate", .options_json = NormaliseEffect(kStruck)->dump()}).ok());
  EXPECT_EQ(*base::HashFile(root_ / "live.h5"), *base::HashFile(root_ / "batch.h5"));
}

TEST_F(LiveTest, WhatIsSavedHasCopies) {
  json effect = kStruck;
  effect["persistence"] = {{{"interval_s", 0.25}, {"end_s", 0.8}}};
  Seen seen;
  const auto client = Open(effect, seen);
  ASSERT_TRUE(Play(*client, 0).ok());
  ASSERT_TRUE(client->Save(root_ / "live.h5").ok());
  const auto stored = storage::ReadSimulatedTake(root_ / "live.h5");
  ASSERT_TRUE(stored.ok()) << stored.status();
  const SimulatedTake batch = Batch(effect);
  ASSERT_GT(batch.copies.copy.size(), 0U);
  EXPECT_EQ(stored->copies.offset, batch.copies.offset);
  EXPECT_EQ(stored->copies.copy, batch.copies.copy);
  EXPECT_EQ(stored->copies.cell, batch.copies.cell);
  ASSERT_EQ(stored->copies.translation.size(), batch.copies.translation.size());
  for (std::size_t i = 0; i < batch.copies.translation.size(); ++i) {
    EXPECT_LT((stored->copies.translation[i] - batch.copies.translation[i]).norm(), 2e-6) << i;  // made of positions that are rounded to floats
  }
}

/// In free fall the heights of successive frames bend by g dt²; without gravity they do not.
TEST_F(LiveTest, AChangeHoldsFromItsFrameOn) {
  const json effect = {
      {"name", "free"}, {"duration_s", 0.6}, {"rate_hz", 60}, {"ground", {{"enabled", false}}}, {"release", {{{"by", "height"}, {"end_s", 0}}}}};
  take_ = std::make_shared<const TrackedTake>(testing::Animate(testing::CubeBlock(1, 1, 1, 0.05, 1), 10, 25, testing::Still));
  Seen seen;
  const auto client = Open(effect, seen);
  ASSERT_TRUE(Play(*client, 6).ok());
  ASSERT_TRUE(Change(*client, "gravity_m_s2", "0").ok());
  EXPECT_TRUE(seen.refused().empty());
  ASSERT_TRUE(Play(*client, 0).ok());
  const std::map<int, std::string> instants = seen.instants();
  const SimulatedTake batch = Batch(effect);
  ASSERT_EQ(instants.size(), batch.time.size());
  for (std::size_t s = 0; s <= 6; ++s) {
    EXPECT_EQ(WithoutDepths(instants.at(static_cast<int>(s))), BatchInstant(batch, s, static_cast<double>(batch.time.size()))) << "frame " << s;
  }
  std::vector<double> height;
  for (const auto& [frame, bytes] : instants) {
    v1::LiveInstant instant;
    ASSERT_TRUE(instant.ParseFromString(bytes));
    SimulatedTake one;
    ASSERT_TRUE(Unpack(instant, 1, 0, one).ok());
    height.push_back(one.cell_translation[0].y());
  }
  const double dt = 1.0 / 25;
  for (std::size_t s = 2; s + 1 < height.size(); ++s) {
    if (s == 6) continue;  // the frame between
    EXPECT_NEAR((height[s + 1] - 2 * height[s] + height[s - 1]) / (dt * dt), s < 6 ? -9.81 : 0, 0.01) << "frame " << s;
  }
  // It says so in what is stored.
  ASSERT_TRUE(client->Save(root_ / "changed.h5").ok());
  const auto provenance = storage::ReadProvenance(root_ / "changed.h5");
  ASSERT_TRUE(provenance.ok());
  EXPECT_EQ(provenance->kind, "live");
  const json stored = json::parse(provenance->options_json);
  ASSERT_EQ(stored["effects"].size(), 2U);
  EXPECT_EQ(stored["effects"][1]["frame"], 6);
  EXPECT_EQ(stored["effects"][1]["effect"]["gravity_m_s2"], 0);
}

TEST_F(LiveTest, GoingBackRepeatsTheSameFramesAndAnotherChangeReplacesWhatCameLater) {
  Seen seen;
  const auto client = Open(kFalling, seen);
  ASSERT_TRUE(Play(*client, 5).ok());
  ASSERT_TRUE(Change(*client, "gravity_m_s2", "-3").ok());
  ASSERT_TRUE(Play(*client, 4).ok());
  ASSERT_TRUE(Change(*client, "recall.stiffness_s2", "90").ok());
  ASSERT_TRUE(Play(*client, 0).ok());
  const std::map<int, std::string> first = seen.instants();
  EXPECT_EQ(client->frames(), 26U);
  ASSERT_TRUE(Rewind(*client, 2).ok());
  EXPECT_EQ(json::parse(client->effect_json())["gravity_m_s2"], 9.81);
  ASSERT_TRUE(Play(*client, 0).ok());
  EXPECT_EQ(seen.instants(), first);
  // On to a frame that was shown before, too.
  ASSERT_TRUE(Rewind(*client, 0).ok());
  ASSERT_TRUE(Rewind(*client, 25).ok());
  EXPECT_EQ(seen.instants(), first);

  ASSERT_TRUE(Rewind(*client, 3).ok());
  ASSERT_TRUE(Change(*client, "rupture.acceleration_m_s2", "1e6").ok());
  EXPECT_TRUE(seen.refused().empty());
  EXPECT_EQ(client->frames(), 4U);
  ASSERT_TRUE(Play(*client, 0).ok());
  // What was changed at 5 and 9 is gone; a threshold that nothing reaches changes nothing.
  ExpectBatch(seen.instants(), kFalling);
  const json now = json::parse(client->effect_json());
  EXPECT_EQ(now["gravity_m_s2"], 9.81);
  EXPECT_EQ(now["rupture"]["acceleration_m_s2"], 1e6);
}

TEST_F(LiveTest, TheSceneCanBeChangedAtFrameZeroOnly) {
  Seen seen;
  const auto client = Open(kStruck, seen);
  ASSERT_TRUE(Play(*client, 2).ok());
  ASSERT_TRUE(Change(*client, "ball.mass_kg", "1").ok());
  ASSERT_EQ(seen.refused().size(), 1U);
  EXPECT_THAT(seen.refused()[0], HasSubstr("rewind to 0"));
  ASSERT_TRUE(Rewind(*client, 0).ok());
  ASSERT_TRUE(Change(*client, "", kFalling.dump()).ok());
  ASSERT_EQ(seen.scenes().size(), 2U);
  EXPECT_EQ(seen.scenes()[0].objects_size(), 1);
  EXPECT_EQ(seen.scenes()[1].objects_size(), 0);
  ASSERT_TRUE(Play(*client, 0).ok());
  ExpectBatch(seen.instants(), kFalling);
}

TEST_F(LiveTest, SeveralUsersAtOnceDoNotDisturbEachOther) {
  Seen seen_one, seen_two;
  const auto one = Open(kFalling, seen_one);
  const auto two = Open(kStruck, seen_two);
  v1::LiveRequest play;
  play.set_play(0);
  ASSERT_TRUE(one->Ask(play).ok());
  ASSERT_TRUE(two->Ask(play).ok());
  ASSERT_TRUE(one->AwaitStill().ok());
  ASSERT_TRUE(two->AwaitStill().ok());
  ExpectBatch(seen_one.instants(), kFalling);
  ExpectBatch(seen_two.instants(), kStruck);
}

TEST_F(LiveTest, MoreSessionsThanItTakesAreRefusedUntilOneEnds) {
  Serve({.sessions_max = 1});
  Seen seen;
  const auto first = Open(kFalling, seen);
  ASSERT_TRUE(first->AwaitStill().ok());
  const absl::Status refused = Open(kFalling, seen)->AwaitStill();
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(refused.message()), HasSubstr("--live-max"));
  ASSERT_TRUE(first->Close().ok());
  EXPECT_TRUE(Open(kFalling, seen)->AwaitStill().ok());
}

/// A client that says of nothing that it received it gets so much and no more, and is let go.
TEST_F(LiveTest, ASlowReaderHoldsABoundedNumberOfFramesAndIsLetGo) {
  Serve({.idle_max = absl::Seconds(1)});
  grpc::ClientContext context;
  auto stream = stub_->Live(&context);
  v1::LiveRequest request;
  request.mutable_open()->set_tracked_key("take");
  request.mutable_open()->set_effect_json(kFalling.dump());
  ASSERT_TRUE(stream->Write(request));
  request.set_play(0);
  ASSERT_TRUE(stream->Write(request));
  v1::LiveFrame frame;
  int frames = 0;
  while (stream->Read(&frame)) ++frames;
  EXPECT_EQ(frames, 4);
  const grpc::Status status = stream->Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  EXPECT_THAT(status.error_message(), HasSubstr("open another session"));
}

TEST_F(LiveTest, RefusesWhatIsWrongAndGoesOn) {
  Seen seen;
  const auto client = Open(kFalling, seen);
  ASSERT_TRUE(Play(*client, 2).ok());
  const std::string deep(100000, '[');
  for (const auto& [path, value, told] : std::vector<std::array<std::string, 3>>{{"gravity_m_s2", "{", "value_json"},
                                                                                 {"gravity", "1", "no field \"gravity\""},
                                                                                 {"recall.", "1", "no field"},
                                                                                 {"release.7.end_s", "1", "no field"},
                                                                                 {"rate_hz", "1", "rate_hz"},
                                                                                 {"", "7", "effect"},
                                                                                 {"", R"({"name": "x", "morph": {}})", "morph"},
                                                                                 {"", deep + std::string(100000, ']'), "deep"},
                                                                                 {std::string(1000, 'a'), "1", "path"}}) {
    const std::size_t before = seen.refused().size();
    ASSERT_TRUE(Change(*client, path, value).ok());
    ASSERT_EQ(seen.refused().size(), before + 1) << path;
    EXPECT_THAT(seen.refused().back(), HasSubstr(told));
  }
  const std::size_t before = seen.refused().size();
  ASSERT_TRUE(Rewind(*client, 3).ok());  // not computed yet
  ASSERT_TRUE(Rewind(*client, -1).ok());
  ASSERT_TRUE(Play(*client, -1).ok());
  v1::LiveRequest again;
  again.mutable_open()->set_tracked_key("take");
  ASSERT_TRUE(client->Ask(again).ok());
  ASSERT_TRUE(client->AwaitStill().ok());
  EXPECT_EQ(seen.refused().size(), before + 4);
  ASSERT_TRUE(Play(*client, 0).ok());
  ExpectBatch(seen.instants(), kFalling);
}

TEST_F(LiveTest, ASessionThatCannotBeOpenedEndsWithTheReason) {
  const auto open = [&](const std::string& key, const std::string& effect) {
    grpc::ClientContext context;
    auto stream = stub_->Live(&context);
    v1::LiveRequest request;
    if (effect.empty()) {
      request.set_play(1);
    } else {
      request.mutable_open()->set_tracked_key(key);
      request.mutable_open()->set_effect_json(effect);
    }
    stream->Write(request);
    v1::LiveFrame frame;
    EXPECT_FALSE(stream->Read(&frame));
    return stream->Finish();
  };
  EXPECT_EQ(open("other", kFalling.dump()).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(open("take", "").error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(open("take", "{").error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  const grpc::Status morph = open("take", R"({"name": "x", "morph": {}})");
  EXPECT_EQ(morph.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(morph.error_message(), HasSubstr("morph"));
}

TEST_F(LiveTest, ACancelledCallStopsItsRun) {
  Serve({.sessions_max = 1});
  const json endless = {{"name", "long"}, {"duration_s", 3000}, {"output_fps", 1}, {"release", {{{"by", "height"}, {"end_s", 3000}}}}};
  Seen seen;
  {
    const auto client = Open(endless, seen);
    ASSERT_TRUE(client->AwaitStill().ok());
    v1::LiveRequest play;
    play.set_play(0);
    ASSERT_TRUE(client->Ask(play).ok());
  }  // cancels
  const auto deadline = absl::Now() + absl::Seconds(20);
  absl::Status status;
  do {
    Seen other;
    status = Open(kFalling, other)->AwaitStill();
  } while (absl::IsResourceExhausted(status) && absl::Now() < deadline);
  EXPECT_TRUE(status.ok()) << status;
}

struct Script {
  int exit_code = -1;
  std::string printed;  // standard output, then error
};

Script RunScript(const std::filesystem::path& tracked, const std::string& commands, std::vector<std::string> more = {}) {
  Script script;
  lease::ChildCommand command{.program = VOROCAST_SIMULATION, .arguments = {"live", tracked.string(), "--effect", "release"}, .input = commands};
  command.arguments.insert(command.arguments.end(), more.begin(), more.end());
  const lease::StopFlag stop;
  const auto end = lease::RunChild(command, stop, [&](std::string_view line) { script.printed.append(line).append("\n"); });
  EXPECT_TRUE(end.ok()) << end.status();
  if (!end.ok()) return script;
  script.exit_code = end->code;
  script.printed += end->printed;
  return script;
}

TEST_F(LiveTest, TheCommandWorksOffAScript) {
  const std::filesystem::path tracked = root_ / "tracked.h5";
  ASSERT_TRUE(storage::WriteTrackedTake(tracked, *take_, {.kind = "assemble", .key = "take", .options_json = "{}"}).ok());
  for (const std::vector<std::string>& where : {std::vector<std::string>{}, {"--at", server_->address()}}) {
    const std::filesystem::path saved = root_ / "saved.h5";
    std::filesystem::remove(saved);
    const Script script = RunScript(
        tracked, fmt::format("# a script\ngo 12\nset gravity_m_s2 3\nstep\nrewind 12\nshow gravity_m_s2\nsave {}\nquit\nnever\n", saved.string()),
        where);
    EXPECT_EQ(script.exit_code, 0) << script.printed;
    EXPECT_THAT(script.printed, HasSubstr("36 cells"));
    EXPECT_THAT(script.printed, HasSubstr("frame 13/"));
    EXPECT_THAT(script.printed, HasSubstr("ms a step"));
    EXPECT_THAT(script.printed, HasSubstr("changed from frame 12 on\n"));
    EXPECT_THAT(script.printed, HasSubstr("\n3.0\n"));
    EXPECT_THAT(script.printed, HasSubstr("14 frames written"));
    const auto stored = storage::ReadSimulatedTake(saved);
    ASSERT_TRUE(stored.ok()) << stored.status();
    EXPECT_EQ(stored->time.size(), 14U);
  }
  const Script wrong = RunScript(tracked, "set gravity 3\ngo\n");
  EXPECT_NE(wrong.exit_code, 0);
  EXPECT_THAT(wrong.printed, HasSubstr("no field \"gravity\""));
  EXPECT_THAT(wrong.printed, ::testing::Not(HasSubstr("frame 1/")));
  const Script unknown = RunScript(tracked, "jump\n");
  EXPECT_NE(unknown.exit_code, 0);
  EXPECT_THAT(unknown.printed, HasSubstr("help"));
}

TEST(LiveField, IsFoundByNamesAndNumbers) {
  const json effect = {{"recall", {{"stiffness_s2", 1}}}, {"release", {{{"end_s", 2}}}}, {"objects", {{{"name", "ball"}, {"mass_kg", 3}}}}};
  EXPECT_EQ(*FieldOf(effect, "recall.stiffness_s2"), 1);
  EXPECT_EQ(*FieldOf(effect, "release.0.end_s"), 2);
  EXPECT_EQ(*FieldOf(effect, "objects.ball.mass_kg"), 3);
  EXPECT_EQ(*FieldOf(effect, "ball.mass_kg"), 3);
  EXPECT_EQ((*WithField(effect, "ball.mass_kg", 4))["objects"][0]["mass_kg"], 4);
  for (const char* path : {"", ".", "release.1.end_s", "release.-1", "recall.stiffness_s2.x", "objects.cube"}) {
    EXPECT_EQ(FieldOf(effect, path).status().code(), absl::StatusCode::kInvalidArgument) << path;
  }
}

TEST(LiveMessage, RefusesWhatDoesNotFitTheTake) {
  v1::LiveInstant instant;
  SimulatedTake take;
  EXPECT_EQ(Unpack(instant, 1, 0, take).code(), absl::StatusCode::kDataLoss);
  instant.set_rotation(std::string(16, '\0'));
  instant.set_translation(std::string(12, '\0'));
  instant.set_state(std::string(1, '\0'));
  EXPECT_TRUE(Unpack(instant, 1, 0, take).ok());
  EXPECT_EQ(Unpack(instant, 1, 1, take).code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(Unpack(instant, 2, 0, take).code(), absl::StatusCode::kDataLoss);
  instant.set_state("\x03");
  EXPECT_EQ(Unpack(instant, 1, 0, take).code(), absl::StatusCode::kDataLoss);
}

}  // namespace
}  // namespace vorocast::simulation
