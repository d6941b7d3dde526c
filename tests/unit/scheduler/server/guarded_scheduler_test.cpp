// SPDX-License-Identifier: AGPL-3.0-or-later
// A scheduler that asks for tokens, and its Artifacts service, over real gRPC.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "absl/time/clock.h"
#include "proto/artifacts.grpc.pb.h"
#include "proto/capture.grpc.pb.h"
#include "proto/dispatch.grpc.pb.h"
#include "proto/jobs.grpc.pb.h"
#include "scheduler/server/scheduler_server.h"
#include "services/rpc/channel.h"
#include "services/rpc/status.h"
#include "services/rpc/tokens.h"
#include "services/storage/artifact_store.h"
#include "services/tasks/task.h"

namespace vorocast::server {
namespace {

using testing::HasSubstr;

class GuardedScheduler : public testing::Test {
 protected:
  void SetUp() override {
    state_ = std::filesystem::temp_directory_path() / fmt::format("vorocast_guarded_{}", getpid());
    std::filesystem::remove_all(state_);
    std::filesystem::create_directories(state_);
    for (const auto& [name, role] :
         std::map<std::string, std::string>{{"anna", "submit"}, {"bob", "submit"}, {"olga", "operate"}, {"farm", "work"}}) {
      const auto made = rpc::MakeToken(name, *rpc::RolesFromNames(role));
      std::ofstream(state_ / name) << made->token;
      lines_[name] = made->line;
    }
    WriteTokens();
    auto guard = rpc::OpenGuard({.tokens = (state_ / "tokens").string()}, nullptr);
    ASSERT_TRUE(guard.ok()) << guard.status();
    auto server = SchedulerServer::Start({.state = state_, .listen = "unix:" + (state_ / "s.sock").string(), .guard = *guard});
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    artifacts_.emplace(*storage::ArtifactStore::Open(state_));
  }
  void TearDown() override {
    server_.reset();
    std::filesystem::remove_all(state_);
  }
  void WriteTokens() const {
    std::ofstream out(state_ / "tokens");
    for (const auto& [name, line] : lines_) out << line << "\n";
  }
  std::shared_ptr<grpc::Channel> As(const std::string& name) {
    return *rpc::Connect(server_->address(), rpc::ClientSecurity{.token_file = (state_ / name).string()});
  }
  template <typename Service, typename Request, typename Reply>
  absl::StatusOr<Reply> Call(const std::string& name, grpc::Status (Service::Stub::*method)(grpc::ClientContext*, const Request&, Reply*),
                             const Request& request) {
    const auto stub = Service::NewStub(As(name));
    grpc::ClientContext context;
    context.set_deadline(absl::ToChronoTime(absl::Now() + absl::Seconds(30)));
    Reply reply;
    RETURN_IF_ERROR(rpc::FromGrpc((*stub.*method)(&context, request, &reply)));
    return reply;
  }
  /// A job of anna's on one frame; its id.
  std::string SubmitOneFrame() {
    v1::OpenSequenceRequest open;
    open.set_session("s");
    open.set_name("take");
    open.set_frames_per_second(25);
    open.set_metres_per_unit(1);
    open.set_up("+y");
    const auto sequence = Call<v1::Captures>("anna", &v1::Captures::Stub::Open, open);
    EXPECT_TRUE(sequence.ok()) << sequence.status();
    const std::string bytes = "a frame";
    v1::Blob blob;
    blob.set_sha256(base::HashBytes(bytes).Hex());
    blob.set_extension(".ply");
    blob.set_size(static_cast<std::int64_t>(bytes.size()));
    {
      const auto stub = v1::Captures::NewStub(As("anna"));
      grpc::ClientContext context;
      v1::UploadReply reply;
      const auto stream = stub->Upload(&context, &reply);
      v1::UploadChunk chunk;
      *chunk.mutable_blob() = blob;
      chunk.set_data(bytes);
      stream->Write(chunk);
      stream->WritesDone();
      EXPECT_TRUE(stream->Finish().ok());
    }
    blob_ = blob.sha256();
    v1::AddFramesRequest add;
    add.set_sequence_id(sequence->id());
    *add.add_frames()->mutable_blob() = blob;
    EXPECT_TRUE(Call<v1::Captures>("anna", &v1::Captures::Stub::Add, add).ok());
    v1::SubmitJobRequest submit;
    submit.set_sequence_id(sequence->id());
    submit.set_cells(100);
    submit.set_template_frame(-1);
    submit.set_user("somebody else");
    const auto job = Call<v1::Jobs>("anna", &v1::Jobs::Stub::Submit, submit);
    EXPECT_TRUE(job.ok()) << job.status();
    EXPECT_EQ(job->user(), "anna") << "whose token it is, that user's job it is";
    return job->id();
  }
  absl::Status Cancel(const std::string& name, const std::string& job) {
    v1::JobRequest request;
    request.set_job_id(job);
    return Call<v1::Jobs>(name, &v1::Jobs::Stub::Cancel, request).status();
  }

  absl::Status Put(
      const std::string& key, const std::string& bytes, const std::function<void(v1::PutArtifactChunk&)>& change = [](auto&) {},
      const std::string& name = "farm") {
    const auto stub = v1::Artifacts::NewStub(As(name));
    grpc::ClientContext context;
    context.set_deadline(absl::ToChronoTime(absl::Now() + absl::Seconds(30)));
    v1::PutArtifactReply reply;
    const auto stream = stub->Put(&context, &reply);
    v1::PutArtifactChunk chunk;
    chunk.mutable_name()->set_kind(v1::ArtifactName::RESULT);
    chunk.mutable_name()->set_digest(key);
    chunk.mutable_name()->set_extension(".h5");
    chunk.set_size(static_cast<std::int64_t>(bytes.size()));
    chunk.set_sha256(base::HashBytes(bytes).Hex());
    change(chunk);
    stream->Write(chunk);
    chunk.Clear();
    chunk.set_data(bytes);
    stream->Write(chunk);
    stream->WritesDone();
    return rpc::FromGrpc(stream->Finish());
  }
  absl::StatusOr<std::string> Get(v1::ArtifactName::Kind kind, const std::string& digest, const std::string& extension,
                                  const std::string& name = "farm") {
    const auto stub = v1::Artifacts::NewStub(As(name));
    grpc::ClientContext context;
    v1::GetArtifactRequest request;
    request.mutable_name()->set_kind(kind);
    request.mutable_name()->set_digest(digest);
    request.mutable_name()->set_extension(extension);
    const auto stream = stub->Get(&context, request);
    std::string bytes;
    v1::ArtifactChunk chunk;
    while (stream->Read(&chunk)) bytes += chunk.data();
    RETURN_IF_ERROR(rpc::FromGrpc(stream->Finish()));
    return bytes;
  }

  std::filesystem::path state_;
  std::map<std::string, std::string> lines_;
  std::unique_ptr<SchedulerServer> server_;
  std::optional<storage::ArtifactStore> artifacts_;
  std::string blob_;
};

/// A worker that takes leases and finishes nothing.
class Holder {
 public:
  explicit Holder(std::shared_ptr<grpc::Channel> channel) : stub_(v1::Dispatch::NewStub(std::move(channel))), stream_(stub_->Work(&context_)) {
    v1::WorkerMessage hello;
    hello.mutable_hello()->set_worker("holder");
    hello.mutable_hello()->set_slots(1);
    for (const tasks::Kind kind : tasks::kAllKinds) hello.mutable_hello()->add_kinds(std::string(tasks::Name(kind)));
    stream_->Write(hello);
  }
  ~Holder() {
    context_.TryCancel();
    (void)stream_->Finish();
  }
  /// The first lease; nothing when the stream ends.
  std::optional<tasks::TaskSpec> AwaitLease() {
    v1::SchedulerMessage message;
    while (stream_->Read(&message)) {
      if (!message.has_leases() || message.leases().leases().empty()) continue;
      return *tasks::TaskSpecFromJson(nlohmann::json::parse(message.leases().leases(0).spec_json()));
    }
    return std::nullopt;
  }
  bool Beat() {
    v1::WorkerMessage message;
    message.mutable_heartbeat();
    return stream_->Write(message);
  }

 private:
  grpc::ClientContext context_;
  std::unique_ptr<v1::Dispatch::Stub> stub_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::WorkerMessage, v1::SchedulerMessage>> stream_;
};

TEST_F(GuardedScheduler, OnlyItsOwnerOrAnOperatorChangesAJob) {
  const std::string job = SubmitOneFrame();
  const absl::Status others = Cancel("bob", job);
  EXPECT_EQ(others.code(), absl::StatusCode::kPermissionDenied);
  EXPECT_THAT(std::string(others.message()), HasSubstr("belongs to anna"));
  EXPECT_EQ(Cancel("farm", job).code(), absl::StatusCode::kPermissionDenied);
  v1::JobRequest request;
  request.set_job_id(job);
  for (const auto method : {&v1::Jobs::Stub::Pause, &v1::Jobs::Stub::Resume}) {
    EXPECT_EQ(Call<v1::Jobs>("bob", method, request).status().code(), absl::StatusCode::kPermissionDenied);
    EXPECT_TRUE(Call<v1::Jobs>("anna", method, request).ok());
    EXPECT_TRUE(Call<v1::Jobs>("olga", method, request).ok());
  }
  EXPECT_TRUE(Cancel("anna", job).ok());
  v1::RetryJobRequest retry;
  retry.set_job_id(job);
  EXPECT_EQ(Call<v1::Jobs>("bob", &v1::Jobs::Stub::Retry, retry).status().code(), absl::StatusCode::kPermissionDenied);
  EXPECT_TRUE(Call<v1::Jobs>("olga", &v1::Jobs::Stub::Retry, retry).ok());
  EXPECT_TRUE(Cancel("olga", job).ok());
  EXPECT_EQ(Cancel("bob", "no such job").code(), absl::StatusCode::kNotFound);
}

TEST_F(GuardedScheduler, AWithdrawnTokenEndsItsWorkersStream) {
  Holder holder(As("farm"));
  SubmitOneFrame();
  ASSERT_TRUE(holder.AwaitLease().has_value());
  lines_.erase("farm");
  WriteTokens();
  bool open = true;
  for (const absl::Time deadline = absl::Now() + absl::Seconds(30); open && absl::Now() < deadline; absl::SleepFor(absl::Milliseconds(20))) {
    open = holder.Beat();
  }
  EXPECT_FALSE(open);
}

TEST_F(GuardedScheduler, ALeasedResultIsPutAndGot) {
  SubmitOneFrame();
  Holder holder(As("farm"));
  const auto spec = holder.AwaitLease();
  ASSERT_TRUE(spec.has_value());
  const std::string key = spec->Key().Hex();
  EXPECT_EQ(*Get(v1::ArtifactName::BLOB, blob_, ".ply"), "a frame");
  EXPECT_EQ(Get(v1::ArtifactName::RESULT, key, ".h5").status().code(), absl::StatusCode::kNotFound);
  const std::string bytes(3'000'000, 'x');
  const auto in_chunks = [&](const std::string& whole) {
    const auto stub = v1::Artifacts::NewStub(As("farm"));
    grpc::ClientContext context;
    v1::PutArtifactReply reply;
    const auto stream = stub->Put(&context, &reply);
    v1::PutArtifactChunk chunk;
    chunk.mutable_name()->set_kind(v1::ArtifactName::RESULT);
    chunk.mutable_name()->set_digest(key);
    chunk.mutable_name()->set_extension(".h5");
    chunk.set_size(static_cast<std::int64_t>(whole.size()));
    chunk.set_sha256(base::HashBytes(whole).Hex());
    stream->Write(chunk);
    for (std::size_t at = 0; at < whole.size(); at += 1 << 20) {
      chunk.Clear();
      chunk.set_data(whole.substr(at, 1 << 20));
      stream->Write(chunk);
    }
    stream->WritesDone();
    return rpc::FromGrpc(stream->Finish());
  };
  ASSERT_TRUE(in_chunks(bytes).ok());
  EXPECT_EQ(*Get(v1::ArtifactName::RESULT, key, ".h5"), bytes);
  EXPECT_TRUE(in_chunks(bytes).ok()) << "what is there already may be put again";
  EXPECT_EQ(Put(key, "other bytes").code(), absl::StatusCode::kAlreadyExists) << "the first result stays";
  EXPECT_EQ(*Get(v1::ArtifactName::RESULT, key, ".h5"), bytes);
  EXPECT_EQ(Get(v1::ArtifactName::BLOB, blob_, ".ply", "anna").status().code(), absl::StatusCode::kPermissionDenied);
}

TEST_F(GuardedScheduler, AWrongPutLeavesNothingBehind) {
  SubmitOneFrame();
  Holder holder(As("farm"));
  const auto spec = holder.AwaitLease();
  ASSERT_TRUE(spec.has_value());
  const std::string key = spec->Key().Hex();
  const auto code = [&](const std::function<void(v1::PutArtifactChunk&)>& change, const std::string& bytes = "result") {
    return Put(key, bytes, change).code();
  };
  EXPECT_EQ(Put(base::HashBytes("nobody's").Hex(), "result").code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Put(
                key, "result", [](auto&) {}, "olga")
                .code(),
            absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(code([](auto& c) { c.set_sha256(base::HashBytes("another").Hex()); }), absl::StatusCode::kDataLoss);
  EXPECT_EQ(code([](auto& c) { c.set_size(7); }), absl::StatusCode::kDataLoss) << "truncated";
  EXPECT_EQ(code([](auto& c) { c.set_size(5); }), absl::StatusCode::kDataLoss) << "more than announced";
  EXPECT_EQ(code([](auto& c) { c.set_size(std::int64_t{1} << 50); }), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code([](auto& c) { c.set_size(-1); }), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code([](auto& c) { c.clear_name(); }), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code([](auto& c) { c.mutable_name()->set_kind(v1::ArtifactName::BLOB); }), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code([](auto&) {}, std::string((1 << 20) + 1, 'x')), absl::StatusCode::kInvalidArgument) << "a chunk that is too large";
  for (const char* extension : {"", ".ply", ".png", "/../../x.h5", ".h5/..", "../x"}) {
    EXPECT_EQ(code([&](auto& c) { c.mutable_name()->set_extension(extension); }), absl::StatusCode::kInvalidArgument) << extension;
  }
  for (const std::string& digest : {std::string("../../etc/passwd"), std::string(), key.substr(1), std::string(64, '/'), std::string(64, 'A')}) {
    EXPECT_EQ(code([&](auto& c) { c.mutable_name()->set_digest(digest); }), absl::StatusCode::kInvalidArgument) << digest;
    EXPECT_EQ(Get(v1::ArtifactName::BLOB, digest, ".ply").status().code(), absl::StatusCode::kInvalidArgument) << digest;
  }
  for (const char* extension : {"", ".h5", "/../../x", "../x"}) {
    EXPECT_EQ(Get(v1::ArtifactName::BLOB, blob_, extension).status().code(), absl::StatusCode::kInvalidArgument) << extension;
  }
  EXPECT_FALSE(artifacts_->HasArtifact(spec->Key(), ".h5"));
  EXPECT_TRUE(std::filesystem::is_empty(state_ / "tmp"));
}

}  // namespace
}  // namespace vorocast::server
