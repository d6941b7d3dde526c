// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/simulation_service.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>

#include "absl/time/clock.h"
#include "services/rpc/server.h"
#include "services/simulation/effect.h"
#include "services/simulation/simulate.h"
#include "services/simulation/simulate_executor.h"
#include "services/storage/hdf5_artifacts.h"
#include "tests/unit/services/simulation/synthetic_take.h"

namespace vorocast::simulation {
namespace {

using ::testing::HasSubstr;

/// A service on a folder that holds one tracked take, with the real program behind it.
class SimulationServiceTest : public ::testing::Test {
 protected:
  void SetUp() override {
    root_ = std::filesystem::path(::testing::TempDir()) /
            fmt::format("vorocast_simulation_{}", ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::remove_all(root_);
    auto store = storage::ArtifactStore::Open(root_);
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = std::make_unique<storage::ArtifactStore>(*std::move(store));
    take_ = testing::Animate(testing::CubeBlock(3, 4, 3, 0.05), 10, 25, testing::Sway);
    tracked_ = base::HashBytes("a take");
    const std::filesystem::path temporary = store_->TemporaryPath(".h5");
    const absl::Status written = storage::WriteTrackedTake(temporary, take_, {.kind = "assemble", .key = tracked_.Hex(), .options_json = "{}"});
    ASSERT_TRUE(written.ok()) << written;
    ASSERT_TRUE(store_->PublishArtifact(temporary, tracked_, ".h5").ok());
    service_ = std::make_unique<SimulationService>(SimulationService::Options{.store = *store_, .program = VOROCAST_SIMULATION});
    auto server = rpc::StartServer({.services = {service_.get()}});
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    stub_ = v1::Simulation::NewStub(grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials()));
  }
  void TearDown() override {
    server_.reset();
    std::filesystem::remove_all(root_);
  }

  grpc::Status Run(const std::string& key, const std::string& effect, v1::RunProgress& last, std::vector<double>* fractions = nullptr) {
    grpc::ClientContext context;
    v1::RunRequest request;
    request.set_tracked_key(key);
    request.set_effect_json(effect);
    auto reader = stub_->Run(&context, request);
    while (reader->Read(&last)) {
      if (fractions != nullptr) fractions->push_back(last.fraction());
    }
    return reader->Finish();
  }

  std::filesystem::path root_;
  std::unique_ptr<storage::ArtifactStore> store_;
  geometry::TrackedTake take_;
  base::Digest tracked_;
  std::unique_ptr<SimulationService> service_;
  std::unique_ptr<rpc::Server> server_;
  std::unique_ptr<v1::Simulation::Stub> stub_;
};

TEST_F(SimulationServiceTest, TellsTheEffectsAndTheirSchema) {
  grpc::ClientContext context;
  v1::EffectsReply reply;
  ASSERT_TRUE(stub_->Effects(&context, {}, &reply).ok());
  ASSERT_EQ(reply.effects_size(), static_cast<int>(ShippedEffects().size()));
  EXPECT_EQ(reply.effects(0).name(), "calm");
  EXPECT_FALSE(reply.effects(0).description().empty());
  EXPECT_TRUE(ParseEffect(reply.effects(1).effect_json()).ok());
  EXPECT_THAT(reply.schema_json(), HasSubstr("draft-07"));
}

TEST_F(SimulationServiceTest, ChecksAnEffect) {
  v1::CheckRequest request;
  v1::CheckReply reply;
  request.set_effect_json(R"({"name": "x", "rate_hz": 100})");
  grpc::ClientContext good;
  ASSERT_TRUE(stub_->Check(&good, request, &reply).ok());
  EXPECT_EQ(reply.effect_json(), NormaliseEffect({{"name", "x"}, {"rate_hz", 100}})->dump());
  request.set_effect_json(R"({"name": "x", "rate_hz": 1})");
  grpc::ClientContext bad;
  const grpc::Status refused = stub_->Check(&bad, request, &reply);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(refused.error_message(), "effect: rate_hz: 1 is not a number from 10 to 10000");
}

TEST_F(SimulationServiceTest, RunsAndPublishesUnderTheTasksKey) {
  const auto effect = *NormaliseEffect({{"name", "x"}, {"release", {{{"by", "height"}, {"end_s", 0.2}}}}});
  v1::RunProgress last;
  std::vector<double> fractions;
  const grpc::Status status = Run(tracked_.Hex(), effect.dump(), last, &fractions);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(fractions.back(), 1);
  EXPECT_TRUE(std::ranges::is_sorted(fractions));
  const base::Digest key = SimulateTask(tracked_, effect).Key();
  EXPECT_EQ(last.simulated_key(), key.Hex());
  const auto stored = storage::ReadSimulatedTake(store_->ArtifactPath(key, ".h5"));
  ASSERT_TRUE(stored.ok()) << stored.status();
  // The other process came to the same result, bit for bit.
  const auto here = Simulate(*storage::ReadTrackedTake(store_->ArtifactPath(tracked_, ".h5")), effect, {});
  ASSERT_TRUE(here.ok());
  EXPECT_EQ(stored->effect_json, here->effect_json);
  EXPECT_EQ(stored->time, here->time);
  ASSERT_EQ(stored->cell_translation.size(), here->cell_translation.size());
  for (std::size_t i = 0; i < here->cell_translation.size(); ++i) {
    EXPECT_EQ(stored->cell_translation[i].cast<float>(), here->cell_translation[i].cast<float>());  // as the file has it
  }
  EXPECT_EQ(stored->cell_rotation, here->cell_rotation);
  EXPECT_EQ(stored->cell_state, here->cell_state);
  const auto provenance = storage::ReadProvenance(store_->ArtifactPath(key, ".h5"));
  ASSERT_TRUE(provenance.ok());
  EXPECT_EQ(provenance->kind, "simulate");
  EXPECT_EQ(provenance->inputs, std::vector<std::string>{"tracked:" + tracked_.Hex()});
  // A second time it is there already.
  v1::RunProgress again;
  ASSERT_TRUE(Run(tracked_.Hex(), effect.dump(), again).ok());
  EXPECT_EQ(again.simulated_key(), key.Hex());
}

TEST_F(SimulationServiceTest, RefusesWhatItCannotRun) {
  v1::RunProgress last;
  EXPECT_EQ(Run("xyz", R"({"name": "x"})", last).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(Run(base::HashBytes("no take").Hex(), R"({"name": "x"})", last).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(Run(tracked_.Hex(), "{", last).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(SimulationServiceTest, PlaysATakeOfItsStoreLive) {
  const auto open = [&](const std::string& key, v1::LiveFrame& frame) {
    grpc::ClientContext context;
    auto stream = stub_->Live(&context);
    v1::LiveRequest request;
    request.mutable_open()->set_tracked_key(key);
    request.mutable_open()->set_effect_json(R"({"name": "x"})");
    stream->Write(request);
    stream->Read(&frame);
    stream->WritesDone();
    return stream->Finish();
  };
  for (int session = 0; session < 6; ++session) {  // more than it takes at once
    v1::LiveFrame frame;
    const grpc::Status status = open(tracked_.Hex(), frame);
    ASSERT_TRUE(status.ok()) << status.error_message();
    EXPECT_EQ(frame.scene().cells(), 36);
    EXPECT_EQ(frame.scene().frames(), 10);
    EXPECT_EQ(frame.requests(), 1);
    EXPECT_TRUE(frame.paused());
  }
  v1::LiveFrame none;
  EXPECT_EQ(open(base::HashBytes("no take").Hex(), none).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(open("../../etc", none).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(SimulationServiceTest, ACancelledCallStopsItsRun) {
  grpc::ClientContext context;
  v1::RunRequest request;
  request.set_tracked_key(tracked_.Hex());
  request.set_effect_json(R"({"name": "long", "duration_s": 3000, "rate_hz": 1000, "release": [{"by": "height", "end_s": 3000}]})");
  auto reader = stub_->Run(&context, request);
  v1::RunProgress progress;
  ASSERT_TRUE(reader->Read(&progress));  // it is under way
  context.TryCancel();
  while (reader->Read(&progress)) {
  }
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::CANCELLED);
  // The slot is free again, once the service has seen it: another run is taken.
  const auto deadline = absl::Now() + absl::Seconds(20);
  grpc::Status status;
  do {
    status = Run(tracked_.Hex(), R"({"name": "short", "duration_s": 0.2})", progress);
  } while (status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED && absl::Now() < deadline);
  EXPECT_TRUE(status.ok()) << status.error_message();
}

}  // namespace
}  // namespace vorocast::simulation
