// SPDX-License-Identifier: AGPL-3.0-or-later
// Real servers on this machine, with real certificates.
#include "services/rpc/security.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "absl/time/clock.h"
#include "proto/simulation.grpc.pb.h"
#include "services/rpc/channel.h"
#include "services/rpc/server.h"
#include "services/rpc/status.h"
#include "tests/support/certificates.h"

namespace vorocast::rpc {
namespace {

const support::TestCertificates& Certificates() {
  static const support::TestCertificates certificates;
  return certificates;
}

/// Answers every call with what it knows of the caller.
class Answerer final : public v1::Simulation::CallbackService {
 public:
  explicit Answerer(std::shared_ptr<Gate> gate) : gate_(std::move(gate)) {}
  grpc::ServerUnaryReactor* Check(grpc::CallbackServerContext* context, const v1::CheckRequest*, v1::CheckReply* reply) override {
    const auto caller = CallerOf(*context, gate_.get());
    if (caller.ok()) reply->set_effect_json(caller->known ? caller->name : "unknown");
    auto* reactor = context->DefaultReactor();
    reactor->Finish(ToGrpc(caller.status()));
    return reactor;
  }

 private:
  const std::shared_ptr<Gate> gate_;
};

struct Guarded {
  std::unique_ptr<Answerer> service;
  std::unique_ptr<Server> server;
};

Guarded Serve(const ServerSecurity& security, const std::string& listen = "127.0.0.1:0", const std::string& private_door = "") {
  auto guard = OpenGuard(security, nullptr);
  EXPECT_TRUE(guard.ok()) << guard.status();
  guard->private_door = private_door;
  Guarded guarded;
  guarded.service = std::make_unique<Answerer>(guard->gate);
  auto server = StartServer({.listen = listen, .services = {guarded.service.get()}, .guard = *guard});
  EXPECT_TRUE(server.ok()) << server.status();
  guarded.server = *std::move(server);
  return guarded;
}

template <typename Call>
absl::Status WithStub(const std::string& address, const ClientSecurity& security, const Call& call) {
  ASSIGN_OR_RETURN(const auto channel, Connect(address, security));
  const auto stub = v1::Simulation::NewStub(channel);
  grpc::ClientContext context;
  context.set_deadline(absl::ToChronoTime(absl::Now() + absl::Seconds(20)));
  return FromGrpc(call(*stub, context));
}

absl::StatusOr<std::string> Ask(const std::string& address, const ClientSecurity& security) {
  v1::CheckReply reply;
  RETURN_IF_ERROR(WithStub(
      address, security, [&](v1::Simulation::Stub& stub, grpc::ClientContext& context) { return stub.Check(&context, v1::CheckRequest(), &reply); }));
  return reply.effect_json();
}

std::string PortOf(const std::string& address) { return address.substr(address.rfind(':')); }

ServerSecurity Tls(const std::string& name = "server") {
  return {.certificate = Certificates().Certificate(name), .key = Certificates().Key(name), .client_ca = "", .tokens = ""};
}
ClientSecurity Believing(const std::string& authority) {
  return {.tls = true, .ca = Certificates().Certificate(authority), .certificate = "", .key = "", .token_file = ""};
}
ClientSecurity Showing(const std::string& certificate) {
  ClientSecurity security = Believing("ca");
  security.certificate = Certificates().Certificate(certificate);
  security.key = Certificates().Key(certificate);
  return security;
}

/// A tokens file and a token file of each of its names.
struct TokenFiles {
  explicit TokenFiles(const std::string& name) : tokens((Certificates().folder() / (name + ".tokens")).string()), name_(name) {}
  std::string Add(const std::string& who, const std::string& roles) {
    const auto made = MakeToken(who, *RolesFromNames(roles));
    lines_[who] = made->line;
    Write();
    const std::string path = (Certificates().folder() / (name_ + "." + who + ".token")).string();
    std::ofstream(path) << made->token << "\n";
    return path;
  }
  void Withdraw(const std::string& who) {
    lines_.erase(who);
    Write();
  }
  void Write() const {
    std::ofstream out(tokens);
    for (const auto& [who, line] : lines_) out << line << "\n";
  }
  const std::string tokens;

 private:
  const std::string name_;
  std::map<std::string, std::string> lines_;
};

TEST(Tls, IsSpokenWithWhoeverBelievesTheAuthority) {
  const Guarded guarded = Serve(Tls());
  const auto reply = Ask(guarded.server->address(), Believing("ca"));
  ASSERT_TRUE(reply.ok()) << reply.status();
  EXPECT_EQ(*reply, "unknown");
  EXPECT_TRUE(Ask("localhost" + PortOf(guarded.server->address()), Believing("ca")).ok());
}

TEST(Tls, IsNotSpokenWithAServerOfAnotherAuthority) {
  const Guarded guarded = Serve(Tls());
  EXPECT_EQ(Ask(guarded.server->address(), Believing("stranger")).status().code(), absl::StatusCode::kUnavailable);
}

TEST(Tls, IsNotSpokenWithAServerSignedByItself) {
  const Guarded guarded = Serve(Tls("self"));
  EXPECT_EQ(Ask(guarded.server->address(), Believing("ca")).status().code(), absl::StatusCode::kUnavailable);
}

TEST(Tls, IsNotSpokenWithAnExpiredCertificate) {
  const Guarded guarded = Serve(Tls("expired"));
  EXPECT_EQ(Ask(guarded.server->address(), Believing("ca")).status().code(), absl::StatusCode::kUnavailable);
}

TEST(Tls, IsNotSpokenUnderANameThatTheCertificateDoesNotHave) {
  // 127.0.0.2 reaches the same server, but its certificate is for 127.0.0.1.
  const Guarded guarded = Serve(Tls(), "0.0.0.0:0");
  EXPECT_TRUE(Ask("127.0.0.1" + PortOf(guarded.server->address()), Believing("ca")).ok());
  EXPECT_FALSE(Ask("127.0.0.2" + PortOf(guarded.server->address()), Believing("ca")).ok());
}

TEST(Tls, IsNotLeftOut) {
  const Guarded guarded = Serve(Tls());
  EXPECT_FALSE(Ask(guarded.server->address(), ClientSecurity{}).ok());
}

TEST(MutualTls, AsksForACertificateOfTheAuthority) {
  ServerSecurity security = Tls();
  security.client_ca = Certificates().Certificate("ca");
  const Guarded guarded = Serve(security);
  const auto shown = Ask(guarded.server->address(), Showing("client"));
  EXPECT_TRUE(shown.ok()) << shown.status();
  EXPECT_FALSE(Ask(guarded.server->address(), Believing("ca")).ok()) << "without a certificate";
  EXPECT_FALSE(Ask(guarded.server->address(), Showing("intruder")).ok()) << "with one of another authority";
}

TEST(TlsFiles, AreReadAgainWhenTheyChange) {
  const auto copy = [](const std::string& from, const std::string& to) {
    // Whole or not at all, as whoever renews certificates has to do it.
    std::filesystem::copy_file(from, to + ".new", std::filesystem::copy_options::overwrite_existing);
    std::filesystem::rename(to + ".new", to);
  };
  ServerSecurity security = Tls();
  security.certificate = (Certificates().folder() / "renewed.pem").string();
  security.key = (Certificates().folder() / "renewed.key").string();
  copy(Certificates().Certificate("expired"), security.certificate);
  copy(Certificates().Key("expired"), security.key);
  const Guarded guarded = Serve(security);
  EXPECT_FALSE(Ask(guarded.server->address(), Believing("ca")).ok());
  copy(Certificates().Key("server"), security.key);
  copy(Certificates().Certificate("server"), security.certificate);
  absl::StatusOr<std::string> reply = absl::UnknownError("");
  for (const absl::Time deadline = absl::Now() + absl::Seconds(60); !reply.ok() && absl::Now() < deadline; absl::SleepFor(absl::Milliseconds(100))) {
    reply = Ask(guarded.server->address(), Believing("ca"));
  }
  EXPECT_TRUE(reply.ok()) << reply.status();
}

TEST(TlsFiles, ThatCannotWorkAreNamed) {
  ServerSecurity security = Tls();
  security.key = Certificates().Key("client");
  EXPECT_THAT(std::string(OpenGuard(security, nullptr).status().message()), testing::HasSubstr("is not the key of"));
  security.key = "";
  EXPECT_THAT(std::string(OpenGuard(security, nullptr).status().message()), testing::HasSubstr("give both"));
  security.key = "/nowhere/server.key";
  EXPECT_EQ(OpenGuard(security, nullptr).status().code(), absl::StatusCode::kNotFound);
  security.key = security.certificate;
  EXPECT_THAT(std::string(OpenGuard(security, nullptr).status().message()), testing::HasSubstr("private key"));
  security = Tls();
  security.client_ca = Certificates().Key("server");
  EXPECT_THAT(std::string(OpenGuard(security, nullptr).status().message()), testing::HasSubstr("--client-ca"));
  EXPECT_FALSE(Connect("localhost:1", ClientSecurity{.tls = true, .ca = "/nowhere/ca.pem"}).ok());
}

TEST(TokenCheck, GoesByTheTokenOverTls) {
  TokenFiles files("tls");
  const std::string reader = files.Add("reader", "read");
  const std::string worker = files.Add("worker", "work");
  ServerSecurity security = Tls();
  security.tokens = files.tokens;
  const Guarded guarded = Serve(security);
  ClientSecurity client = Believing("ca");
  EXPECT_EQ(Ask(guarded.server->address(), client).status().code(), absl::StatusCode::kUnauthenticated);
  client.token_file = reader;
  EXPECT_EQ(*Ask(guarded.server->address(), client), "reader");
  client.token_file = worker;
  EXPECT_EQ(Ask(guarded.server->address(), client).status().code(), absl::StatusCode::kPermissionDenied);
  TokenFiles others("others");
  client.token_file = others.Add("reader", "operate");
  EXPECT_EQ(Ask(guarded.server->address(), client).status().code(), absl::StatusCode::kUnauthenticated);
}

TEST(TokenCheck, WorksOnThisMachineWithoutTls) {
  TokenFiles files("local");
  const std::string reader = files.Add("reader", "read");
  const std::string socket = (Certificates().folder() / "local.sock").string();
  for (const std::string& listen : {std::string("127.0.0.1:0"), "unix:" + socket}) {
    const Guarded guarded = Serve({.tokens = files.tokens}, listen);
    EXPECT_EQ(Ask(guarded.server->address(), ClientSecurity{}).status().code(), absl::StatusCode::kUnauthenticated) << listen;
    const auto reply = Ask(guarded.server->address(), ClientSecurity{.token_file = reader});
    ASSERT_TRUE(reply.ok()) << listen << ": " << reply.status();
    EXPECT_EQ(*reply, "reader");
  }
}

TEST(TokenCheck, ComesBeforeAMethodThatNobodyServes) {
  TokenFiles files("methods");
  const std::string boss = files.Add("boss", "operate");
  const Guarded guarded = Serve({.tokens = files.tokens});
  const auto effects = [&](const ClientSecurity& client) {
    return WithStub(guarded.server->address(), client, [&](v1::Simulation::Stub& stub, grpc::ClientContext& context) {
      v1::EffectsReply reply;
      return stub.Effects(&context, v1::EffectsRequest(), &reply);
    });
  };
  EXPECT_EQ(effects({}).code(), absl::StatusCode::kUnauthenticated);
  EXPECT_EQ(effects({.token_file = boss}).code(), absl::StatusCode::kUnimplemented);
}

TEST(TokenCheck, WithdrawingATokenNeedsNoRestart) {
  TokenFiles files("withdrawn");
  const std::string leaver = files.Add("leaver", "read");
  const std::string stayer = files.Add("stayer", "read");
  const Guarded guarded = Serve({.tokens = files.tokens});
  ASSERT_TRUE(Ask(guarded.server->address(), {.token_file = leaver}).ok());
  files.Withdraw("leaver");
  absl::Status status;
  for (const absl::Time deadline = absl::Now() + absl::Seconds(20); status.ok() && absl::Now() < deadline; absl::SleepFor(absl::Milliseconds(20))) {
    status = Ask(guarded.server->address(), {.token_file = leaver}).status();
  }
  EXPECT_EQ(status.code(), absl::StatusCode::kUnauthenticated);
  EXPECT_TRUE(Ask(guarded.server->address(), {.token_file = stayer}).ok());
}

TEST(PrivateDoor, LetsThisUserInWithoutATokenAndTheOtherDoorDoesNot) {
  TokenFiles files("private");
  files.Add("somebody", "read");
  ServerSecurity security = Tls();
  security.tokens = files.tokens;
  const Guarded guarded = Serve(security, "127.0.0.1:0", "unix:" + (Certificates().folder() / "private.sock").string());
  EXPECT_EQ(*Ask(guarded.server->address_here(), ClientSecurity{}), "unknown");
  EXPECT_EQ(*Ask(guarded.server->address_here(), Believing("ca")), "unknown") << "TLS is for the network";
  EXPECT_EQ(Ask(guarded.server->address(), Believing("ca")).status().code(), absl::StatusCode::kUnauthenticated);
}

TEST(Guard, ThatDoesNotFitItsAddressIsRefused) {
  TokenFiles files("fit");
  files.Add("somebody", "read");
  const auto in_clear = OpenGuard({.tokens = files.tokens}, nullptr);
  EXPECT_THAT(std::string(StartServer({.listen = "0.0.0.0:0", .guard = *in_clear}).status().message()), testing::HasSubstr("--server-certificate"));
  const auto tls = OpenGuard(Tls(), nullptr);
  EXPECT_EQ(StartServer({.listen = "unix:/tmp/never.sock", .guard = *tls}).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(Guard, SaysWhenAnybodyMayComeIn) {
  EXPECT_TRUE(IsUnguarded("0.0.0.0:7400", {}));
  EXPECT_TRUE(IsUnguarded("farm:7400", {.security = Tls()})) << "TLS alone asks nobody who they are";
  EXPECT_FALSE(IsUnguarded("127.0.0.1:7400", {}));
  EXPECT_FALSE(IsUnguarded("unix:/run/x.sock", {}));
  ServerSecurity mutual = Tls();
  mutual.client_ca = Certificates().Certificate("ca");
  EXPECT_FALSE(IsUnguarded("0.0.0.0:7400", {.security = mutual}));
}

TEST(Client, DoesNotSendATokenInClearOverANetwork) {
  TokenFiles files("clear");
  const std::string token = files.Add("somebody", "read");
  for (const char* address : {"farm:7400", "192.0.2.1:7400", "0.0.0.0:7400", "127.evil.example:7400", "localhost.evil.example:7400"}) {
    EXPECT_EQ(Connect(address, ClientSecurity{.token_file = token}).status().code(), absl::StatusCode::kFailedPrecondition) << address;
  }
  for (const char* address : {"localhost:7400", "127.0.0.1:7400", "127.3.4.5:7400", "[::1]:7400", "unix:/run/x.sock"}) {
    EXPECT_TRUE(Connect(address, ClientSecurity{.token_file = token}).ok()) << address;
  }
  EXPECT_TRUE(Connect("farm:7400", ClientSecurity{.tls = true, .token_file = token}).ok());
  EXPECT_EQ(Connect("localhost:7400", ClientSecurity{.token_file = "/nowhere/token"}).status().code(), absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace vorocast::rpc
