// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rpc/server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include <fmt/format.h>
#include <unistd.h>

#include "absl/time/clock.h"
#include "proto/simulation.grpc.pb.h"
#include "services/rpc/channel.h"
#include "services/rpc/status.h"

namespace vorocast::rpc {
namespace {

class Echo final : public v1::Simulation::CallbackService {
 public:
  grpc::ServerUnaryReactor* Check(grpc::CallbackServerContext* context, const v1::CheckRequest* request, v1::CheckReply* reply) override {
    reply->set_effect_json(request->effect_json());
    auto* reactor = context->DefaultReactor();
    reactor->Finish(request->effect_json().empty() ? ToGrpc(absl::InvalidArgumentError("effect_json: empty")) : grpc::Status::OK);
    return reactor;
  }
};

absl::StatusOr<std::string> CallEcho(const std::string& address, const std::string& text) {
  const auto stub = v1::Simulation::NewStub(Connect(address));
  grpc::ClientContext context;
  context.set_wait_for_ready(true);
  context.set_deadline(absl::ToChronoTime(absl::Now() + absl::Seconds(20)));
  v1::CheckRequest request;
  request.set_effect_json(text);
  v1::CheckReply reply;
  RETURN_IF_ERROR(FromGrpc(stub->Check(&context, request, &reply)));
  return reply.effect_json();
}

TEST(Server, TellsTheChosenPort) {
  Echo echo;
  auto server = StartServer({.listen = "127.0.0.1:0", .services = {&echo}});
  ASSERT_TRUE(server.ok()) << server.status();
  EXPECT_FALSE((*server)->address().ends_with(":0"));
  EXPECT_EQ(*CallEcho((*server)->address(), "hello"), "hello");
}

TEST(Server, ListensOnAUnixSocket) {
  Echo echo;
  const auto path = std::filesystem::temp_directory_path() / fmt::format("rpc_server_test_{}.sock", getpid());
  auto server = StartServer({.listen = "unix:" + path.string(), .services = {&echo}});
  ASSERT_TRUE(server.ok()) << server.status();
  EXPECT_EQ(*CallEcho((*server)->address(), "hello"), "hello");
  server->reset();
  std::filesystem::remove(path);
}

TEST(Server, KeepsCodeAndMessageOfAnError) {
  Echo echo;
  auto server = StartServer({.listen = "127.0.0.1:0", .services = {&echo}});
  ASSERT_TRUE(server.ok()) << server.status();
  const auto reply = CallEcho((*server)->address(), "");
  EXPECT_EQ(reply.status(), absl::InvalidArgumentError("effect_json: empty"));
}

TEST(Server, RefusesATakenPort) {
  Echo echo;
  auto first = StartServer({.listen = "127.0.0.1:0", .services = {&echo}});
  ASSERT_TRUE(first.ok());
  Echo other;
  const auto second = StartServer({.listen = (*first)->address(), .services = {&other}});
  EXPECT_EQ(second.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(second.status().message()), testing::HasSubstr((*first)->address()));
}

TEST(Server, RefusesAUnixPathThatDoesNotFit) {
  Echo echo;
  EXPECT_EQ(StartServer({.listen = "unix:/tmp/" + std::string(120, 'x'), .services = {&echo}}).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(ParseDigest, NamesTheField) {
  EXPECT_TRUE(ParseDigest(std::string(64, 'a'), "sha256").ok());
  EXPECT_THAT(std::string(ParseDigest("abc", "sha256").status().message()), testing::StartsWith("sha256: "));
}

}  // namespace
}  // namespace vorocast::rpc
