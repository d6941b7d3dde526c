// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/scheduler_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>

#include <fmt/format.h>
#include <unistd.h>

#include "absl/time/clock.h"
#include "fake_worker.h"
#include "proto/capture.grpc.pb.h"
#include "proto/jobs.grpc.pb.h"
#include "services/base/digest.h"
#include "services/rpc/channel.h"
#include "services/rpc/status.h"
#include "services/telemetry/metrics_server.h"
#include "tests/support/scrape.h"

namespace vorocast::server {
namespace {

using testing::Contains;
using testing::HasSubstr;

class SchedulerServerTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    state_ = std::filesystem::temp_directory_path() / fmt::format("vorocast_{}_{}", info->name(), getpid());
    std::filesystem::remove_all(state_);
    std::filesystem::create_directories(state_);
    address_ = "unix:" + (state_ / "s.sock").string();
    StartScheduler();
    artifacts_.emplace(*storage::ArtifactStore::Open(state_));
  }
  void TearDown() override {
    worker_.reset();
    server_.reset();
    std::filesystem::remove_all(state_);
  }

  void StartScheduler() {
    auto server = SchedulerServer::Start({.state = state_, .listen = address_, .collection = collection_});
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    captures_ = v1::Captures::NewStub(rpc::Connect(address_));
    jobs_ = v1::Jobs::NewStub(rpc::Connect(address_));
  }
  void StartWorker(FakeWorker::Behaviour behaviour = {}) { worker_ = std::make_unique<FakeWorker>(address_, *artifacts_, std::move(behaviour)); }

  template <typename Stub, typename Request, typename Reply>
  absl::StatusOr<Reply> Call(Stub& stub, grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Reply*), const Request& request) {
    grpc::ClientContext context;
    context.set_wait_for_ready(true);
    context.set_deadline(absl::ToChronoTime(absl::Now() + absl::Seconds(30)));
    Reply reply;
    RETURN_IF_ERROR(rpc::FromGrpc((stub.*method)(&context, request, &reply)));
    return reply;
  }

  absl::StatusOr<v1::Sequence> Open(double frames_per_second = 25, const std::string& name = "take 1") {
    v1::OpenSequenceRequest request;
    request.set_session("monday");
    request.set_name(name);
    request.set_frames_per_second(frames_per_second);
    request.set_metres_per_unit(0.01);
    request.set_up("+y");
    return Call<v1::Captures::StubInterface>(*captures_, &v1::Captures::StubInterface::Open, request);
  }
  absl::Status Upload(const v1::Blob& blob, const std::string& bytes) {
    grpc::ClientContext context;
    v1::UploadReply reply;
    const auto stream = captures_->Upload(&context, &reply);
    v1::UploadChunk chunk;
    *chunk.mutable_blob() = blob;
    stream->Write(chunk);
    chunk.clear_blob();
    chunk.set_data(bytes);
    stream->Write(chunk);
    stream->WritesDone();
    return rpc::FromGrpc(stream->Finish());
  }
  static std::string Bytes(int frame) { return fmt::format("points of frame {}", frame); }
  static v1::Blob BlobOf(int frame) {
    v1::Blob blob;
    blob.set_sha256(base::HashBytes(Bytes(frame)).Hex());
    blob.set_extension(".ply");
    blob.set_size(static_cast<std::int64_t>(Bytes(frame).size()));
    return blob;
  }
  absl::StatusOr<v1::Sequence> AddFrames(const std::string& sequence, int first, int last) {
    v1::AddFramesRequest request;
    request.set_sequence_id(sequence);
    for (int i = first; i < last; ++i) {
      RETURN_IF_ERROR(Upload(BlobOf(i), Bytes(i)));
      v1::Frame& frame = *request.add_frames();
      frame.set_number(i);
      *frame.mutable_blob() = BlobOf(i);
    }
    return Call<v1::Captures::StubInterface>(*captures_, &v1::Captures::StubInterface::Add, request);
  }
  absl::StatusOr<v1::Sequence> Close(const std::string& sequence) {
    v1::CloseSequenceRequest request;
    request.set_sequence_id(sequence);
    return Call<v1::Captures::StubInterface>(*captures_, &v1::Captures::StubInterface::Close, request);
  }
  absl::StatusOr<v1::Job> Submit(
      const std::string& sequence, const std::function<void(v1::SubmitJobRequest&)>& change = [](auto&) {}) {
    v1::SubmitJobRequest request;
    request.set_sequence_id(sequence);
    request.set_cells(100);
    request.set_iterations(3);
    request.set_template_frame(-1);
    request.set_window_frames(4);
    request.set_interpolated_max(1);
    request.set_sheets(true);
    request.set_user("anna");
    change(request);
    return Call<v1::Jobs::StubInterface>(*jobs_, &v1::Jobs::StubInterface::Submit, request);
  }
  absl::StatusOr<v1::Job> Get(const std::string& job) {
    v1::JobRequest request;
    request.set_job_id(job);
    return Call<v1::Jobs::StubInterface>(*jobs_, &v1::Jobs::StubInterface::Get, request);
  }
  /// The last message of a Watch.
  absl::StatusOr<v1::Job> WatchToEnd(const std::string& id) {
    grpc::ClientContext context;
    context.set_deadline(absl::ToChronoTime(absl::Now() + absl::Seconds(30)));
    v1::JobRequest request;
    request.set_job_id(id);
    const auto stream = jobs_->Watch(&context, request);
    v1::Job job;
    while (stream->Read(&job)) continue;
    RETURN_IF_ERROR(rpc::FromGrpc(stream->Finish()));
    return job;
  }
  std::string Explain(const std::string& job, const std::string& task) {
    v1::ExplainRequest request;
    request.set_job_id(job);
    request.set_task(task);
    const auto reply = Call<v1::Jobs::StubInterface>(*jobs_, &v1::Jobs::StubInterface::Explain, request);
    return reply.ok() ? reply->text() : std::string(reply.status().message());
  }
  absl::StatusOr<std::string> Fetch(const std::string& job, const std::string& name) {
    grpc::ClientContext context;
    v1::FetchRequest request;
    request.set_job_id(job);
    request.set_name(name);
    const auto stream = jobs_->Fetch(&context, request);
    std::string bytes;
    v1::FetchChunk chunk;
    while (stream->Read(&chunk)) bytes += chunk.data();
    RETURN_IF_ERROR(rpc::FromGrpc(stream->Finish()));
    return bytes;
  }
  absl::StatusOr<std::vector<v1::TaskAttempt>> Attempts(const std::string& job, const std::string& task = "") {
    grpc::ClientContext context;
    v1::AttemptsRequest request;
    request.set_job_id(job);
    request.set_task(task);
    request.set_logs(true);
    const auto stream = jobs_->Attempts(&context, request);
    std::vector<v1::TaskAttempt> attempts;
    v1::AttemptsReply reply;
    while (stream->Read(&reply)) attempts.insert(attempts.end(), reply.attempts().begin(), reply.attempts().end());
    RETURN_IF_ERROR(rpc::FromGrpc(stream->Finish()));
    return attempts;
  }
  /// Polls until `holds` or half a minute has gone.
  static bool Await(const std::function<bool()>& holds) {
    const absl::Time deadline = absl::Now() + absl::Seconds(30);
    while (absl::Now() < deadline) {
      if (holds()) return true;
      absl::SleepFor(absl::Milliseconds(5));
    }
    return false;
  }

  std::filesystem::path state_;
  std::string address_;
  CollectorOptions collection_;
  std::unique_ptr<SchedulerServer> server_;
  std::optional<storage::ArtifactStore> artifacts_;
  std::unique_ptr<v1::Captures::StubInterface> captures_;
  std::unique_ptr<v1::Jobs::StubInterface> jobs_;
  std::unique_ptr<FakeWorker> worker_;
};

TEST_F(SchedulerServerTest, RunsAJobToItsEnd) {
  const auto sequence = Open();
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  const auto job = Submit(sequence->id());
  ASSERT_TRUE(job.ok()) << job.status();
  StartWorker();
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 5).ok());
  // Work starts before the take has ended.
  EXPECT_TRUE(Await([&] { return worker_->executed().contains("frame 4: tessellate"); }));
  ASSERT_TRUE(AddFrames(sequence->id(), 3, 9).ok());
  ASSERT_TRUE(Close(sequence->id()).ok());
  const auto ended = WatchToEnd(job->id());
  ASSERT_TRUE(ended.ok()) << ended.status();
  EXPECT_EQ(ended->state(), v1::DONE) << ended->DebugString();
  EXPECT_EQ(ended->sequence_name(), "take 1");
  EXPECT_EQ(ended->outputs_size(), 9 + 2 + 3);
  for (const auto& [label, times] : worker_->executed()) EXPECT_EQ(times, 1) << label;
  EXPECT_EQ(*Fetch(job->id(), "tracked.h5"), "assemble");
  EXPECT_EQ(Fetch(job->id(), "nothing.h5").status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(Explain(job->id(), "assemble"), HasSubstr("done"));

  // The same again costs nothing.
  const auto again = Submit(sequence->id());
  const auto reused = WatchToEnd(again->id());
  EXPECT_EQ(reused->state(), v1::DONE);
  for (const v1::Stage& stage : reused->stages()) EXPECT_EQ(stage.reused(), stage.total()) << stage.kind();
  for (const auto& [label, times] : worker_->executed()) EXPECT_EQ(times, 1) << label;
}

TEST_F(SchedulerServerTest, AJobSaysOnWhatTermsItRunsAndWhenItCameAndEnded) {
  StartWorker();
  const auto sequence = Open();
  const double before = absl::ToDoubleSeconds(absl::Now() - absl::UnixEpoch());
  const auto job = Submit(sequence->id(), [](v1::SubmitJobRequest& request) {
    request.set_priority(3);
    request.set_workers_max(2);
    request.set_deadline(4e9);
  });
  ASSERT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(job->session(), sequence->session());
  EXPECT_EQ(job->priority(), 3);
  EXPECT_EQ(job->workers_max(), 2);
  EXPECT_EQ(job->deadline(), 4e9);
  EXPECT_GE(job->submitted(), before);
  EXPECT_EQ(job->ended(), 0);
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 4).ok());
  ASSERT_TRUE(Close(sequence->id()).ok());
  ASSERT_EQ(WatchToEnd(job->id())->state(), v1::DONE);
  server_.reset();
  StartScheduler();
  const auto ended = Get(job->id());
  EXPECT_EQ(ended->workers_max(), 2);
  EXPECT_EQ(ended->session(), sequence->session());
  EXPECT_EQ(ended->submitted(), job->submitted());
  EXPECT_GE(ended->ended(), ended->submitted());
  v1::ListJobsRequest request;
  request.set_session(sequence->session());
  EXPECT_EQ((Call<v1::Jobs::StubInterface>(*jobs_, &v1::Jobs::StubInterface::List, request)->jobs_size()), 1);
  request.set_session("another day");
  EXPECT_EQ((Call<v1::Jobs::StubInterface>(*jobs_, &v1::Jobs::StubInterface::List, request)->jobs_size()), 0);
}

TEST_F(SchedulerServerTest, APauseOutlastsTheSchedulerAndEndsWithAResume) {
  StartWorker();
  const auto sequence = Open();
  const auto job = Submit(sequence->id());
  v1::JobRequest request;
  request.set_job_id(job->id());
  EXPECT_TRUE((Call<v1::Jobs::StubInterface>(*jobs_, &v1::Jobs::StubInterface::Pause, request)->paused()));
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 4).ok());
  ASSERT_TRUE(Close(sequence->id()).ok());
  server_.reset();
  StartScheduler();
  EXPECT_TRUE(Await([&] { return Get(job->id())->stages_size() > 0 && Get(job->id())->sequence_closed(); }));
  EXPECT_TRUE(Get(job->id())->paused());
  EXPECT_THAT(Explain(job->id(), ""), HasSubstr("paused"));
  EXPECT_TRUE(worker_->executed().empty());
  EXPECT_FALSE((Call<v1::Jobs::StubInterface>(*jobs_, &v1::Jobs::StubInterface::Resume, request)->paused()));
  EXPECT_EQ(WatchToEnd(job->id())->state(), v1::DONE);
  EXPECT_EQ((Call<v1::Jobs::StubInterface>(*jobs_, &v1::Jobs::StubInterface::Pause, request).status().code()), absl::StatusCode::kFailedPrecondition);
  const auto fleet = Call<v1::Jobs::StubInterface>(*jobs_, &v1::Jobs::StubInterface::List, v1::ListJobsRequest())->fleet();
  EXPECT_EQ(fleet.workers(), 1);
  EXPECT_EQ(fleet.slots(), 4);
}

TEST_F(SchedulerServerTest, ABadFrameCostsThatFrame) {
  StartWorker({.fails = [](const std::string& label) { return label == "frame 2: tessellate" ? "3 normals are not finite" : ""; }});
  const auto sequence = Open();
  const auto job = Submit(sequence->id());
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 6).ok());
  ASSERT_TRUE(Close(sequence->id()).ok());
  const auto ended = WatchToEnd(job->id());
  ASSERT_TRUE(ended.ok());
  EXPECT_EQ(ended->state(), v1::DONE);
  ASSERT_EQ(ended->failures_size(), 1);
  EXPECT_EQ(ended->failures(0).label(), "frame 2: tessellate");
  EXPECT_THAT(ended->failures(0).cause(), HasSubstr("not finite"));
  EXPECT_EQ(worker_->executed()["frame 2: tessellate"], 1);
}

TEST_F(SchedulerServerTest, TooManyBadFramesFailTheJobWithOneCause) {
  StartWorker({.fails = [](const std::string& label) { return label.ends_with("tessellate") ? "empty file" : ""; }});
  const auto sequence = Open();
  const auto job = Submit(sequence->id());
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 6).ok());
  ASSERT_TRUE(Close(sequence->id()).ok());
  const auto ended = WatchToEnd(job->id());
  ASSERT_TRUE(ended.ok());
  EXPECT_EQ(ended->state(), v1::FAILED);
  EXPECT_THAT(ended->failures(0).cause(), HasSubstr("at most"));
  EXPECT_FALSE(worker_->executed().contains("assemble"));
}

TEST_F(SchedulerServerTest, GoesOnAfterARestart) {
  StartWorker({.holds = [](const std::string& label) { return label == "frame 3: tessellate"; }});
  const auto sequence = Open();
  const auto job = Submit(sequence->id());
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 6).ok());
  ASSERT_TRUE(Close(sequence->id()).ok());
  ASSERT_TRUE(Await([&] { return Get(job->id())->stages(0).done() == 5; }));
  server_.reset();
  StartScheduler();
  // The worker comes back, is told to go on with what it holds, and ends it.
  ASSERT_TRUE(Await([&] { return worker_->went_on() >= 1; }));
  EXPECT_EQ(Get(job->id())->state(), v1::RUNNING);
  worker_->Release();
  const auto ended = WatchToEnd(job->id());
  ASSERT_TRUE(ended.ok()) << ended.status();
  EXPECT_EQ(ended->state(), v1::DONE) << ended->DebugString();
  for (const auto& [label, times] : worker_->executed()) EXPECT_EQ(times, 1) << label;
}

TEST_F(SchedulerServerTest, CancelAndRetry) {
  StartWorker({.holds = [](const std::string& label) { return label == "template"; }});
  const auto sequence = Open();
  const auto job = Submit(sequence->id());
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 6).ok());
  ASSERT_TRUE(Close(sequence->id()).ok());
  ASSERT_TRUE(Await([&] { return Get(job->id())->stages(0).done() == 6; }));
  v1::JobRequest request;
  request.set_job_id(job->id());
  EXPECT_EQ((Call<v1::Jobs::StubInterface>(*jobs_, &v1::Jobs::StubInterface::Cancel, request)->state()), v1::CANCELLED);
  server_.reset();
  StartScheduler();
  EXPECT_TRUE(Await([&] { return Get(job->id())->state() == v1::CANCELLED; }));
  EXPECT_EQ(Get(job->id())->stages(0).done(), 6);
  worker_->Release();
  // The job had ended and is planned anew, which the answer does not wait for.
  v1::RetryJobRequest retry;
  retry.set_job_id(job->id());
  EXPECT_EQ((Call<v1::Jobs::StubInterface>(*jobs_, &v1::Jobs::StubInterface::Retry, retry)->state()), v1::BLOCKED);
  EXPECT_EQ(WatchToEnd(job->id())->state(), v1::DONE);
  EXPECT_EQ(worker_->executed()["frame 0: tessellate"], 1);
}

TEST_F(SchedulerServerTest, AnEndedJobIsShownFromTheRecordAfterARestart) {
  StartWorker({.fails = [](const std::string& label) { return label == "frame 2: tessellate" ? "3 normals are not finite" : ""; }});
  const auto sequence = Open();
  const auto job = Submit(sequence->id());
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 6).ok());
  ASSERT_TRUE(Close(sequence->id()).ok());
  const auto ended = WatchToEnd(job->id());
  ASSERT_EQ(ended->state(), v1::DONE);
  server_.reset();
  StartScheduler();
  EXPECT_EQ(Get(job->id())->SerializeAsString(), ended->SerializeAsString());
  EXPECT_EQ(WatchToEnd(job->id())->outputs_size(), ended->outputs_size());
  EXPECT_EQ(*Fetch(job->id(), "tracked.h5"), "assemble");
  EXPECT_EQ(Fetch(job->id(), "nothing.h5").status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(Explain(job->id(), ""), HasSubstr("done"));
  EXPECT_THAT(Explain(job->id(), "frame 2: tessellate"), HasSubstr("not finite"));
  // Another job on the take is planned from the frames on record, and reuses everything that could be made.
  const auto again = WatchToEnd(Submit(sequence->id())->id());
  EXPECT_EQ(again->state(), v1::DONE);
  EXPECT_EQ(worker_->executed()["frame 1: tessellate"], 1);
}

TEST_F(SchedulerServerTest, ARetryMakesLostAndDamagedResultsAgain) {
  StartWorker();
  const auto sequence = Open();
  const auto job = Submit(sequence->id());
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 6).ok());
  ASSERT_TRUE(Close(sequence->id()).ok());
  const auto ended = WatchToEnd(job->id());
  ASSERT_EQ(ended->state(), v1::DONE);
  const auto path_of = [&](const std::string& name) {
    for (const v1::Output& output : ended->outputs()) {
      if (output.name() == name) return artifacts_->ArtifactPath(*base::Digest::FromHex(output.key()), ".h5");
    }
    return std::filesystem::path();
  };
  std::filesystem::remove(path_of("cells/frame_000001.h5"));
  std::filesystem::permissions(path_of("tracked.h5"), std::filesystem::perms::owner_all);
  std::ofstream(path_of("tracked.h5")) << "Assemble";  // as long as before
  const auto retry = [&] {
    v1::RetryJobRequest request;
    request.set_job_id(job->id());
    return Call<v1::Jobs::StubInterface>(*jobs_, &v1::Jobs::StubInterface::Retry, request);
  };
  ASSERT_TRUE(retry().ok());
  EXPECT_EQ(WatchToEnd(job->id())->state(), v1::DONE);
  EXPECT_EQ(worker_->executed()["frame 1: tessellate"], 2);
  EXPECT_EQ(worker_->executed()["assemble"], 2);
  EXPECT_EQ(worker_->executed()["frame 0: tessellate"], 1);
  EXPECT_EQ(*Fetch(job->id(), "tracked.h5"), "assemble");
  EXPECT_TRUE(std::filesystem::exists(path_of("tracked.h5").string() + ".damaged"));

  // The same for a job that only the record knows.
  server_.reset();
  StartScheduler();
  std::filesystem::remove(path_of("cells/frame_000003.h5"));
  ASSERT_TRUE(retry().ok());
  ASSERT_TRUE(Await([&] { return worker_->executed()["frame 3: tessellate"] == 2; }));
  EXPECT_EQ(WatchToEnd(job->id())->state(), v1::DONE);
  EXPECT_EQ(worker_->executed()["frame 0: tessellate"], 1);
}

TEST_F(SchedulerServerTest, AMorphWaitsForBothTakesAndGoesOnAfterARestart) {
  StartWorker({.holds = [](const std::string& label) { return label == "onto: frame 22: tessellate"; }});
  const auto first = Open();
  const auto second = Open(50, "take 2");
  ASSERT_NE(first->id(), second->id());
  const auto morph = [&](v1::SubmitJobRequest& r) {
    r.set_effect_json(R"({"name": "morph", "morph": {}})");
    r.set_onto_sequence_id(second->id());
  };
  const auto job = Submit(first->id(), morph);
  ASSERT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(job->onto_sequence_name(), "take 2");
  // Frames of both are worked on while they arrive.
  ASSERT_TRUE(AddFrames(first->id(), 0, 3).ok());
  ASSERT_TRUE(AddFrames(second->id(), 20, 22).ok());
  ASSERT_TRUE(Await([&] { return Get(job->id())->stages(0).done() == 5; }));
  ASSERT_TRUE(Close(first->id()).ok());
  ASSERT_TRUE(Await([&] { return worker_->executed().contains("tracked: sheet"); }));
  EXPECT_FALSE(Get(job->id())->sequence_closed());
  server_.reset();
  StartScheduler();
  ASSERT_TRUE(Await([&] {
    const auto now = Get(job->id());
    return now->stages_size() > 0 && now->stages(0).done() == 5;
  }));
  EXPECT_EQ(Get(job->id())->onto_sequence_name(), "take 2");
  // What the scheduler has read from its store still follows both takes.
  ASSERT_TRUE(AddFrames(second->id(), 22, 24).ok());
  ASSERT_TRUE(Close(second->id()).ok());
  ASSERT_TRUE(Await([&] { return worker_->executed().contains("onto: frame 23: tessellate"); }));
  worker_->Release();
  const auto ended = WatchToEnd(job->id());
  ASSERT_TRUE(ended.ok()) << ended.status();
  EXPECT_EQ(ended->state(), v1::DONE) << ended->DebugString();
  for (const auto& [label, times] : worker_->executed()) EXPECT_EQ(times, 1) << label;
  EXPECT_EQ(*Fetch(job->id(), "tracked.h5"), "assemble");
  EXPECT_EQ(*Fetch(job->id(), "onto/tracked.h5"), "onto: assemble");
  EXPECT_EQ(*Fetch(job->id(), "simulated.h5"), "morph: simulate");

  // On record like any other, and a retry finds both takes again.
  server_.reset();
  StartScheduler();
  EXPECT_EQ(Get(job->id())->SerializeAsString(), ended->SerializeAsString());
  std::filesystem::remove(artifacts_->ArtifactPath(*base::Digest::FromHex(ended->outputs(ended->outputs_size() - 1).key()), ".png"));
  v1::RetryJobRequest retry;
  retry.set_job_id(job->id());
  ASSERT_TRUE((Call<v1::Jobs::StubInterface>(*jobs_, &v1::Jobs::StubInterface::Retry, retry).ok()));
  const auto again = WatchToEnd(job->id());
  EXPECT_EQ(again->state(), v1::DONE) << again->DebugString();
  EXPECT_EQ(again->outputs_size(), ended->outputs_size());
  EXPECT_EQ(again->onto_sequence_name(), "take 2");
}

TEST_F(SchedulerServerTest, ATakeMayTurnIntoItself) {
  StartWorker();
  const auto sequence = Open();
  const auto job = Submit(sequence->id(), [&](auto& r) {
    r.set_effect_json(R"({"name": "morph", "morph": {"target_start_s": 1}})");
    r.set_onto_sequence_id(sequence->id());
  });
  ASSERT_TRUE(job.ok()) << job.status();
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 3).ok());
  ASSERT_TRUE(Await([&] { return Get(job->id())->stages_size() > 0 && Get(job->id())->stages(0).done() == 6; }));
  ASSERT_TRUE(Close(sequence->id()).ok());
  EXPECT_EQ(WatchToEnd(job->id())->state(), v1::DONE);
}

TEST_F(SchedulerServerTest, AMorphAndASecondTakeNeedEachOther) {
  const auto first = Open();
  const auto second = Open(25, "take 2");
  const auto refused = [&](const char* effect, const std::string& onto) {
    return Submit(first->id(),
                  [&](auto& r) {
                    r.set_effect_json(effect);
                    r.set_onto_sequence_id(onto);
                  })
        .status();
  };
  const absl::Status none = refused(R"({"name": "melt", "morph": {}})", "");
  EXPECT_EQ(none.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(none.message()), testing::AllOf(HasSubstr("melt"), HasSubstr("onto_sequence_id")));
  EXPECT_EQ(refused(R"({"name": "fall"})", second->id()).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(refused("", second->id()).code(), absl::StatusCode::kInvalidArgument);
  const absl::Status unknown = refused(R"({"name": "melt", "morph": {}})", "s77");
  EXPECT_EQ(unknown.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(unknown.message()), HasSubstr("onto_sequence_id"));
}

TEST_F(SchedulerServerTest, RefusesWhatIsWrong) {
  const auto sequence = Open();
  EXPECT_EQ(Open()->id(), sequence->id());
  EXPECT_EQ(Open(30).status().code(), absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(Open(0).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Submit("s99").status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(Submit(sequence->id(), [](auto& r) { r.set_cells(-5); }).status().message()), HasSubstr("cells"));
  EXPECT_THAT(std::string(Submit(sequence->id(), [](auto& r) { r.set_indicator("magic"); }).status().message()), HasSubstr("spectral"));
  EXPECT_THAT(std::string(Submit(sequence->id(), [](auto& r) { r.set_effect_json("{"); }).status().message()), HasSubstr("effect_json"));
  EXPECT_THAT(std::string(Submit(sequence->id(), [](auto& r) { r.set_workers_max(-1); }).status().message()), HasSubstr("workers_max"));
  EXPECT_THAT(std::string(Submit(sequence->id(), [](auto& r) { r.set_memory_limit(1000); }).status().message()), HasSubstr("memory_limit"));
  EXPECT_THAT(std::string(Submit(sequence->id(), [](auto& r) { r.set_time_factor(NAN); }).status().message()), HasSubstr("time_factor"));
  EXPECT_THAT(std::string(Submit(sequence->id(), [](auto& r) { r.set_time_factor(1e9); }).status().message()), HasSubstr("time_factor"));
  EXPECT_THAT(std::string(Submit(sequence->id(), [](auto& r) { r.set_deadline(NAN); }).status().message()), HasSubstr("deadline"));
  EXPECT_EQ(Get("j99").status().code(), absl::StatusCode::kNotFound);

  v1::Blob blob = BlobOf(1);
  EXPECT_EQ(Upload(blob, "other bytes of it...").code(), absl::StatusCode::kDataLoss);
  blob.set_extension("../../x");
  EXPECT_EQ(Upload(blob, Bytes(1)).code(), absl::StatusCode::kInvalidArgument);
  v1::AddFramesRequest add;
  add.set_sequence_id(sequence->id());
  add.add_frames()->set_number(0);
  *add.mutable_frames(0)->mutable_blob() = BlobOf(0);
  const auto not_there = Call<v1::Captures::StubInterface>(*captures_, &v1::Captures::StubInterface::Add, add);
  EXPECT_EQ(not_there.status().code(), absl::StatusCode::kFailedPrecondition);
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 2).ok());
  *add.mutable_frames(0)->mutable_blob() = BlobOf(1);
  const auto other = Call<v1::Captures::StubInterface>(*captures_, &v1::Captures::StubInterface::Add, add);
  EXPECT_EQ(other.status().code(), absl::StatusCode::kAlreadyExists);
}

TEST_F(SchedulerServerTest, ASecondSchedulerOnTheFolderIsRefused) {
  const auto second = SchedulerServer::Start({.state = state_, .listen = "127.0.0.1:0"});
  EXPECT_EQ(second.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(second.status().message()), HasSubstr(std::to_string(getpid())));
}

TEST_F(SchedulerServerTest, ATakeClosedEmptyFailsItsJob) {
  const auto sequence = Open();
  const auto job = Submit(sequence->id());
  ASSERT_TRUE(Close(sequence->id()).ok());
  const auto ended = WatchToEnd(job->id());
  EXPECT_EQ(ended->state(), v1::FAILED);
  EXPECT_THAT(ended->failures(0).cause(), HasSubstr("without a frame"));
}

TEST_F(SchedulerServerTest, EachAttemptIsKeptWithItsLog) {
  const double before = absl::ToDoubleSeconds(absl::Now() - absl::UnixEpoch());
  const auto sequence = Open();
  const auto job = Submit(sequence->id());
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 6).ok() && Close(sequence->id()).ok());
  std::atomic<int> crashes = 0;
  StartWorker({.fails = [&](const std::string& label) -> std::string {
                 if (label == "frame 2: tessellate") return "INPUT";
                 // The second attempt succeeds.
                 return label == "template" && crashes++ == 0 ? "CRASHED" : "";
               },
               .holds = [](const std::string& label) { return label == "assemble"; }});
  ASSERT_TRUE(Await([&] { return Attempts(job->id(), "assemble").value_or(std::vector<v1::TaskAttempt>{}).size() == 1; }));
  const auto at_work = Attempts(job->id());
  ASSERT_TRUE(at_work.ok()) << at_work.status();
  EXPECT_EQ(at_work->back().task(), "assemble");
  EXPECT_EQ(at_work->back().outcome(), v1::RUNNING);
  EXPECT_EQ(at_work->back().ended(), 0);
  worker_->Release();
  ASSERT_EQ(WatchToEnd(job->id())->state(), v1::DONE);

  const auto check = [&] {
    const auto attempts = Attempts(job->id());
    ASSERT_TRUE(attempts.ok()) << attempts.status();
    const double now = absl::ToDoubleSeconds(absl::Now() - absl::UnixEpoch());
    std::map<std::string, int> times;
    double last = 0;
    for (const v1::TaskAttempt& attempt : *attempts) {
      ++times[attempt.task()];
      EXPECT_EQ(attempt.worker(), "fake-1");
      EXPECT_LE(before - 0.5, attempt.started());  // so long the worker says that each took
      EXPECT_LE(attempt.started(), attempt.ended());
      EXPECT_LE(last, attempt.ended());
      EXPECT_LE(attempt.ended(), now);
      last = attempt.ended();
      const bool bad = attempt.task() == "frame 2: tessellate" || (attempt.task() == "template" && times["template"] == 1);
      EXPECT_EQ(attempt.outcome(), bad ? v1::FAILED : v1::DONE) << attempt.task();
      EXPECT_EQ(attempt.log(), bad ? "what " + attempt.task() + " printed" : "");
      EXPECT_EQ(attempt.cause().empty(), !bad);
      EXPECT_EQ(attempt.memory_peak(), bad ? 7 << 20 : 0);
    }
    EXPECT_EQ(times, worker_->executed());
    EXPECT_EQ(times["template"], 2);
    const auto one = Attempts(job->id(), job->id() + "/template");
    ASSERT_TRUE(one.ok() && one->size() == 2);
    EXPECT_THAT(one->front().cause(), HasSubstr("CRASHED"));
  };
  check();
  server_.reset();
  StartScheduler();
  check();
  EXPECT_THAT(Explain(job->id(), "template"), HasSubstr("after 1 failed attempt."));
  EXPECT_THAT(Explain(job->id(), "guide"), HasSubstr("done"));
  EXPECT_THAT(Explain(job->id(), "no such task"), HasSubstr("no attempt"));
  EXPECT_EQ(Attempts("j99").status().code(), absl::StatusCode::kNotFound);
}

TEST_F(SchedulerServerTest, CapturedFramesCanBeFetched) {
  const auto sequence = Open();
  const auto job = Submit(sequence->id());
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 3).ok());
  EXPECT_EQ(*Fetch(job->id(), "capture/frame_000002.ply"), Bytes(2));
  for (const char* name : {"capture/frame_000003.ply", "capture/frame_000002.obj", "capture/frame_000002", "capture/frame_.ply",
                           "capture/frame_-00002.ply", "capture/../frame_000002.ply", "capture/frame_99999999999999.ply"}) {
    EXPECT_EQ(Fetch(job->id(), name).status().code(), absl::StatusCode::kNotFound) << name;
  }
  // Also once nobody needs the frames any more.
  StartWorker();
  ASSERT_TRUE(Close(sequence->id()).ok());
  ASSERT_EQ(WatchToEnd(job->id())->state(), v1::DONE);
  server_.reset();
  StartScheduler();
  EXPECT_EQ(*Fetch(job->id(), "capture/frame_000001.ply"), Bytes(1));
}

TEST_F(SchedulerServerTest, MetricsEqualARecount) {
  const auto metrics = telemetry::MetricsServer::Start("0", server_->metrics());
  ASSERT_TRUE(metrics.ok()) << metrics.status();
  const auto sequence = Open();
  const auto job = Submit(sequence->id());
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 6).ok() && Close(sequence->id()).ok());
  StartWorker({.slots = 3,
               .fails = [](const std::string& label) { return std::string(label == "frame 2: tessellate" ? "INPUT" : ""); },
               .holds = [](const std::string& label) { return label == "guide"; }});
  ASSERT_TRUE(Await([&] { return support::Scrape((*metrics)->address()).at("vorocast_tasks{kind=\"guide\",phase=\"running\"}") == 1; }));
  // The other tasks that were ready have ended meanwhile, or do so in a moment.
  const auto equal = [&] {
    const auto samples = support::Scrape((*metrics)->address());
    const auto now = Get(job->id());
    double done = 0;
    for (const v1::Stage& stage : now->stages()) {
      const auto of = [&](const char* phase) { return samples.at(fmt::format("vorocast_tasks{{kind=\"{}\",phase=\"{}\"}}", stage.kind(), phase)); };
      if (of("done") != stage.done() || of("failed") != stage.failed() || of("running") != stage.running()) return false;
      if (of("done") + of("failed") + of("running") + of("blocked") + of("ready") + of("cancelled") != stage.total()) return false;
      const double seconds = samples.at(fmt::format("vorocast_task_seconds_count{{kind=\"{}\"}}", stage.kind()));
      if (seconds != stage.done()) return false;
      done += stage.done();
    }
    return samples.at("vorocast_attempts_total{cause=\"none\",outcome=\"done\"}") == done && samples.at("vorocast_busy_slots") == 1;
  };
  EXPECT_TRUE(Await(equal));
  const auto samples = support::Scrape((*metrics)->address());
  EXPECT_EQ(samples.at("vorocast_attempts_total{cause=\"bad_input\",outcome=\"failed\"}"), 1);
  EXPECT_EQ(samples.at("vorocast_workers"), 1);
  EXPECT_EQ(samples.at("vorocast_slots"), 3);
  EXPECT_EQ(samples.at("vorocast_leader_term"), 1);
  EXPECT_EQ(samples.at("vorocast_jobs{phase=\"running\"}"), 1);
  double uploaded = 0;
  for (int frame = 0; frame < 6; ++frame) uploaded += static_cast<double>(Bytes(frame).size());
  EXPECT_EQ(samples.at("vorocast_upload_bytes_total"), uploaded);
  double made = 0;
  for (const auto& [label, times] : worker_->executed()) made += label == "frame 2: tessellate" ? 0 : static_cast<double>(label.size());
  EXPECT_EQ(samples.at("vorocast_artifact_bytes_total"), made);
  EXPECT_GT(samples.at("vorocast_commit_seconds_count"), 0);
  // Values of other labels than these would be without bounds.
  for (const auto& [name, value] : samples) EXPECT_EQ(name.find(job->id()), std::string::npos) << name;
  worker_->Release();
  ASSERT_EQ(WatchToEnd(job->id())->state(), v1::DONE);
  EXPECT_TRUE(Await([&] { return support::Scrape((*metrics)->address()).at("vorocast_jobs{phase=\"running\"}") == 0; }));
}

TEST_F(SchedulerServerTest, TellsWhereWorkersComeFrom) {
  server_->DescribeFleet([] { return std::string("Slurm: 3 workers up"); });
  const auto list = Call<v1::Jobs::StubInterface>(*jobs_, &v1::Jobs::StubInterface::List, v1::ListJobsRequest());
  ASSERT_TRUE(list.ok()) << list.status();
  EXPECT_EQ(list->fleet().description(), "Slurm: 3 workers up");
}

TEST_F(SchedulerServerTest, OnlyWhatNoUnfinishedJobReadsIsCollectedAndAskedForAgainItIsMadeAgain) {
  // The clock of the collection says that everything is forty days old.
  collection_ = {.policy = {.keep = absl::Hours(24 * 30)}, .now = [] { return absl::Now() + absl::Hours(24 * 40); }};
  server_.reset();
  StartScheduler();
  const auto sequence = Open();
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 6).ok() && Close(sequence->id()).ok());
  const auto first = Submit(sequence->id());
  StartWorker({.holds = [](const std::string& label) { return label == "calm: simulate"; }});
  ASSERT_EQ(WatchToEnd(first->id())->state(), v1::DONE);
  // A second job shares all of the first one's results but the sheets, and is held at its last stage.
  const auto second = Submit(sequence->id(), [](v1::SubmitJobRequest& request) {
    request.set_sheets(false);
    request.set_effect_json(R"({"name": "calm"})");
  });
  ASSERT_TRUE(second.ok()) << second.status();
  ASSERT_TRUE(Await([&] { return Attempts(second->id()).value_or(std::vector<v1::TaskAttempt>{}).size() == 1; }));
  const auto shared = server_->Collect();
  ASSERT_TRUE(shared.ok()) << shared.status();
  EXPECT_EQ(shared->remove.size(), 3u);  // the first one's sheets
  for (const Collected& gone : shared->remove) EXPECT_EQ(gone.file.extension, ".png");
  EXPECT_TRUE(Fetch(second->id(), "tracked.h5").ok());
  EXPECT_TRUE(Fetch(second->id(), "capture/frame_000003.ply").ok());
  EXPECT_EQ(Fetch(first->id(), "sheets/cells.png").status().code(), absl::StatusCode::kDataLoss);
  worker_->Release();
  ASSERT_EQ(WatchToEnd(second->id())->state(), v1::DONE);

  // Now nobody needs anything; frames too go.
  const auto all = server_->Collect();
  ASSERT_TRUE(all.ok()) << all.status();
  EXPECT_EQ(all->bytes, all->bytes_before);
  EXPECT_EQ(all->bytes_in_use, 0);
  EXPECT_FALSE(artifacts_->HasBlob(base::HashBytes(Bytes(3)), ".ply"));
  EXPECT_EQ(server_->Collect()->bytes_before, 0);
  // The client sends the frames again, and everything is computed again.
  for (int frame = 0; frame < 6; ++frame) ASSERT_TRUE(Upload(BlobOf(frame), Bytes(frame)).ok());
  const auto third = Submit(sequence->id());
  ASSERT_EQ(WatchToEnd(third->id())->state(), v1::DONE);
  EXPECT_EQ(worker_->executed()["frame 3: tessellate"], 2);
  EXPECT_EQ(worker_->executed()["assemble"], 2);
  EXPECT_EQ(*Fetch(third->id(), "tracked.h5"), "assemble");
}

TEST_F(SchedulerServerTest, FramesOfAnOpenTakeAndWhatIsYoungStay) {
  collection_ = {.policy = {.keep = absl::Hours(1), .keep_at_least = absl::Hours(24)}, .now = [] { return absl::Now() + absl::Hours(2); }};
  server_.reset();
  StartScheduler();
  const auto sequence = Open();
  ASSERT_TRUE(AddFrames(sequence->id(), 0, 3).ok());
  ASSERT_TRUE(Upload(BlobOf(7), Bytes(7)).ok());  // of no take yet
  EXPECT_TRUE(server_->Collect()->remove.empty());
  server_.reset();
  collection_.now = [] { return absl::Now() + absl::Hours(48); };
  StartScheduler();
  const auto plan = server_->Collect();
  ASSERT_TRUE(plan.ok()) << plan.status();
  ASSERT_EQ(plan->remove.size(), 1u);
  EXPECT_EQ(plan->remove[0].file.digest, base::HashBytes(Bytes(7)));
  EXPECT_TRUE(artifacts_->HasBlob(base::HashBytes(Bytes(1)), ".ply"));
}

TEST_F(SchedulerServerTest, ADryRunRemovesNothing) {
  collection_ = {.policy = {.keep = absl::Hours(1)}, .dry_run = true, .now = [] { return absl::Now() + absl::Hours(48); }};
  server_.reset();
  StartScheduler();
  ASSERT_TRUE(Upload(BlobOf(7), Bytes(7)).ok());
  EXPECT_EQ(server_->Collect()->remove.size(), 1u);
  EXPECT_TRUE(artifacts_->HasBlob(base::HashBytes(Bytes(7)), ".ply"));
}

}  // namespace
}  // namespace vorocast::server
