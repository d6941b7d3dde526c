// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rpc/gate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <fstream>
#include <map>
#include <set>

#include <fmt/format.h>

#include "proto/artifacts.pb.h"
#include "proto/capture.pb.h"
#include "proto/dispatch.pb.h"
#include "proto/jobs.pb.h"
#include "proto/simulation.pb.h"

namespace vorocast::rpc {
namespace {

/// A gate with one token a role, a clock that stands, and what it logged.
class GateTest : public testing::Test {
 protected:
  GateTest() {
    for (const auto& [name, role] :
         std::map<std::string, std::string>{{"reader", "read"}, {"submitter", "submit"}, {"operator", "operate"}, {"worker", "work"}})
      Add(name, role);
    Write();
  }
  ~GateTest() override { std::filesystem::remove(file_); }

  void Add(const std::string& name, const std::string& roles) {
    const auto made = MakeToken(name, *RolesFromNames(roles));
    tokens_[name] = made->token;
    lines_[name] = made->line;
  }
  void Write() {
    std::ofstream out(file_);
    for (const auto& [name, line] : lines_) out << line << "\n";
  }
  Gate& Open() {
    auto gate = Gate::Open({.tokens = file_,
                            .requests_per_second = 10,
                            .requests_burst = 1000,
                            .clock = [this] { return now_; },
                            .log = [this](const std::string& text) { log_.push_back(text); }});
    EXPECT_TRUE(gate.ok()) << gate.status();
    gate_ = *gate;
    return *gate_;
  }
  absl::Status As(const std::string& name, const std::string& method) { return gate_->Admit(method, Authorization(tokens_.at(name)), "test"); }

  const std::filesystem::path file_ = std::filesystem::temp_directory_path() / fmt::format("gate_test.{}", ::getpid());
  std::map<std::string, std::string> tokens_, lines_;
  absl::Time now_ = absl::FromUnixSeconds(1'000'000);
  std::vector<std::string> log_;
  std::shared_ptr<Gate> gate_;
};

std::vector<const google::protobuf::FileDescriptor*> AllProtos() {
  return {v1::ArtifactName::descriptor()->file(), v1::Sequence::descriptor()->file(), v1::Hello::descriptor()->file(), v1::Job::descriptor()->file(),
          v1::RunRequest::descriptor()->file()};
}

TEST(AccessTable, HasEveryMethodOfEveryService) {
  int methods = 0;
  for (const auto* file : AllProtos()) {
    for (int s = 0; s < file->service_count(); ++s) {
      const auto* service = file->service(s);
      for (int m = 0; m < service->method_count(); ++m, ++methods) {
        const std::string path = fmt::format("/{}/{}", service->full_name(), service->method(m)->name());
        ASSERT_TRUE(AccessTo(path).has_value()) << path << ": who may call it?";
        EXPECT_FALSE(AccessTo(path)->anybody) << path;
      }
    }
  }
  EXPECT_GT(methods, 15);
}

TEST_F(GateTest, EachRoleReachesWhatItShould) {
  Open();
  const std::set<std::string> reading = {"/vorocast.v1.Jobs/Get",     "/vorocast.v1.Jobs/List",  "/vorocast.v1.Jobs/Watch",
                                         "/vorocast.v1.Jobs/Explain", "/vorocast.v1.Jobs/Fetch", "/vorocast.v1.Simulation/Effects"};
  const std::set<std::string> submitting = {"/vorocast.v1.Captures/Open", "/vorocast.v1.Captures/Upload", "/vorocast.v1.Jobs/Submit",
                                            "/vorocast.v1.Jobs/Cancel",   "/vorocast.v1.Jobs/Pause",      "/vorocast.v1.Simulation/Run", "/vorocast.v1.Simulation/Live"};
  const std::set<std::string> working = {"/vorocast.v1.Dispatch/Work", "/vorocast.v1.Artifacts/Get", "/vorocast.v1.Artifacts/Put"};
  const auto expect = [&](const std::string& who, const std::set<std::string>& methods, bool allowed) {
    for (const std::string& method : methods) {
      EXPECT_EQ(As(who, method).code(), allowed ? absl::StatusCode::kOk : absl::StatusCode::kPermissionDenied) << who << " " << method;
    }
  };
  expect("reader", reading, true);
  expect("reader", submitting, false);
  expect("reader", working, false);
  for (const char* who : {"submitter", "operator"}) {
    expect(who, reading, true);
    expect(who, submitting, true);
    expect(who, working, false);
  }
  expect("worker", reading, false);
  expect("worker", submitting, false);
  expect("worker", working, true);
}

TEST_F(GateTest, AnUnknownMethodIsRefusedToEverybody) {
  Open();
  for (const auto& [name, token] : tokens_) {
    EXPECT_EQ(As(name, "/vorocast.v1.Jobs/Destroy").code(), absl::StatusCode::kPermissionDenied) << name;
    EXPECT_EQ(As(name, "").code(), absl::StatusCode::kPermissionDenied) << name;
  }
}

TEST_F(GateTest, AsksForATokenThatIsOnFile) {
  Gate& gate = Open();
  for (const std::string& shown : {std::string(), std::string("Bearer "), std::string("Bearer vorocast_0"), tokens_["reader"], std::string(9000, 'x'),
                                   "Basic " + tokens_["reader"]}) {
    EXPECT_EQ(gate.Admit("/vorocast.v1.Jobs/List", shown, "test").code(), absl::StatusCode::kUnauthenticated) << shown;
  }
  EXPECT_TRUE(gate.Admit("/grpc.health.v1.Health/Check", "", "test").ok());
}

TEST_F(GateTest, AWithdrawnTokenIsRefusedAtTheNextLook) {
  Open();
  ASSERT_TRUE(As("reader", "/vorocast.v1.Jobs/List").ok());
  lines_.erase("reader");
  Write();
  now_ += absl::Seconds(2);
  EXPECT_EQ(As("reader", "/vorocast.v1.Jobs/List").code(), absl::StatusCode::kUnauthenticated);
  EXPECT_TRUE(As("submitter", "/vorocast.v1.Jobs/List").ok());
  Add("newcomer", "read");
  Write();
  now_ += absl::Seconds(2);
  EXPECT_TRUE(As("newcomer", "/vorocast.v1.Jobs/List").ok());
}

TEST_F(GateTest, AFileThatCannotBeReadLetsNobodyIn) {
  Open();
  std::ofstream(file_) << "broken\n";
  now_ += absl::Seconds(2);
  EXPECT_EQ(As("operator", "/vorocast.v1.Jobs/List").code(), absl::StatusCode::kUnauthenticated);
  Write();
  now_ += absl::Seconds(2);
  EXPECT_TRUE(As("operator", "/vorocast.v1.Jobs/List").ok());
}

TEST_F(GateTest, CallsOfOneNameAreBounded) {
  Open();
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(As("reader", "/vorocast.v1.Jobs/List").ok()) << i;
  EXPECT_EQ(As("reader", "/vorocast.v1.Jobs/List").code(), absl::StatusCode::kResourceExhausted);
  EXPECT_TRUE(As("submitter", "/vorocast.v1.Jobs/List").ok()) << "another's calls are counted apart";
  now_ += absl::Seconds(0.5);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(As("reader", "/vorocast.v1.Jobs/List").ok()) << i;
  EXPECT_FALSE(As("reader", "/vorocast.v1.Jobs/List").ok());
}

TEST_F(GateTest, RefusalsAreLoggedWithoutTheTokenAndWithinBounds) {
  Gate& gate = Open();
  for (int i = 0; i < 500; ++i) (void)gate.Admit("/vorocast.v1.Jobs/List\n\"", "Bearer secret", "1.2.3.4\n");
  ASSERT_FALSE(log_.empty());
  EXPECT_LE(log_.size(), 20u);
  EXPECT_THAT(log_.front(), testing::AllOf(testing::HasSubstr("peer=\"1.2.3.4?\""), testing::HasSubstr("unknown"),
                                           testing::Not(testing::HasSubstr("secret")), testing::Not(testing::HasSubstr("\n"))));
  now_ += absl::Seconds(5);
  (void)gate.Admit("/vorocast.v1.Jobs/List", "", "x");
  EXPECT_THAT(log_.back(), testing::HasSubstr("480 before it"));
}

TEST(Caller, ChangesTheirOwnOnlyUnlessTheyOperate) {
  const auto roles = [](const char* names) { return *RolesFromNames(names); };
  const Caller anna{.known = true, .name = "anna", .roles = roles("submit")};
  EXPECT_TRUE(anna.MayChange("anna"));
  EXPECT_FALSE(anna.MayChange("bob"));
  EXPECT_FALSE(anna.MayChange(""));
  EXPECT_TRUE((Caller{.known = true, .name = "carl", .roles = roles("operate")}.MayChange("anna")));
  EXPECT_TRUE(Caller{}.MayChange("anna")) << "nobody was asked who they are";
}

}  // namespace
}  // namespace vorocast::rpc
