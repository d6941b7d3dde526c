// SPDX-License-Identifier: AGPL-3.0-or-later
// A farm with certificates and tokens, one of whose workers does not see the shared folder: the same results as an undisturbed run's.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tests/cluster/programs.h"
#include "tests/cluster/small_job.h"
#include "tests/support/certificates.h"

namespace vorocast::cluster {
namespace {

using testing::HasSubstr;
using Arguments = std::vector<std::string>;

class GuardedFarm : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_FALSE(UndisturbedDigests().empty());
    folder_ = Scratch() / "guarded";
    std::filesystem::create_directories(folder_);
    std::ofstream(Tokens(), std::ios::out);
    for (const char* role : {"submit", "work", "read", "operate"}) MakeToken(role, role);
    scheduler_ = std::make_unique<Running>(
        Arguments{"--state", state().string(), "--listen", "127.0.0.1:0", "--server-certificate", certificates_.Certificate("server"), "--server-key",
                  certificates_.Key("server"), "--client-ca", certificates_.Certificate("ca"), "--tokens", Tokens()},
        "vorocast-scheduler");
    ASSERT_TRUE(Eventually([&] { return SchedulerPid(state()) == scheduler_->pid() && !Address().empty(); }, 30));
    address_ = Address();
  }

  std::filesystem::path state() const { return folder_ / "state"; }
  std::string Tokens() const { return (folder_ / "tokens").string(); }
  std::string Token(const std::string& name) const { return (folder_ / (name + ".token")).string(); }
  /// `vorocast token new` prints the token first, then the line for the file.
  void MakeToken(const std::string& name, const std::string& role) {
    const Outcome made = RunProgram({"token", "new", name, "--role", role});
    ASSERT_EQ(made.exit_code, 0) << made.output;
    std::istringstream lines(made.output);
    std::string line;
    while (std::getline(lines, line)) {
      if (line.starts_with("vorocast_")) std::ofstream(Token(name)) << line << "\n";
      if (line.starts_with(name + " ")) std::ofstream(Tokens(), std::ios::app) << line << "\n";
    }
  }
  /// From its log: the announcement names the private door.
  std::string Address() const {
    std::ifstream log(state() / "logs" / "scheduler.log");
    const std::string text{std::istreambuf_iterator<char>(log), {}};
    const std::string mark = "serving: address=";
    const std::size_t at = text.find(mark);
    if (at == std::string::npos) return "";
    const std::size_t first = at + mark.size();
    return text.substr(first, text.find_first_of(" \n\"", first) - first);
  }
  Arguments With(Arguments arguments, const std::string& token) const {
    for (const std::string& more : {std::string("--tls-ca"), certificates_.Certificate("ca"), std::string("--tls-certificate"),
                                    certificates_.Certificate("client"), std::string("--tls-key"), certificates_.Key("client")}) {
      arguments.push_back(more);
    }
    if (!token.empty()) arguments.insert(arguments.end(), {"--token-file", Token(token)});
    return arguments;
  }

  support::TestCertificates certificates_;
  std::filesystem::path folder_;
  std::unique_ptr<Running> scheduler_;
  std::string address_;
};

TEST_F(GuardedFarm, DoesTheJobWithAWorkerThatHasNoSharedFolder) {
  const Running far_worker(With({"--scheduler", address_, "--slots", "2", "--artifacts", "remote", "--cache", (folder_ / "cache").string()}, "work"),
                           "vorocast-worker");
  const Running simulation(With({"--scheduler", address_, "--artifacts", "remote", "--cache", (folder_ / "cache").string()}, "work"),
                           "vorocast-simulation");
  Running job(With({"submit", SmallCapture().string(), "--to", address_, "--watch", "--cells", "400", "--patches", "30", "--template", "0",
                    "--no-sheets", "--effect", "calm"},
                   "submit"));
  const Outcome outcome = job.Wait();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  const Outcome fetched = RunProgram(With({"fetch", "--to", address_, "--out", (folder_ / "out").string()}, "read"));
  EXPECT_EQ(fetched.exit_code, 0) << fetched.output;
  EXPECT_EQ(Digests(folder_ / "out"), UndisturbedDigests());
  EXPECT_GT(CountFiles(folder_ / "cache" / "artifacts"), 10u) << "the worker had a folder of its own";

  const auto says = [&](const Arguments& arguments) { return RunProgram(arguments).output; };
  EXPECT_THAT(says(With({"status", "--to", address_}, "read")), HasSubstr(" submit ")) << "the job belongs to the token's name";
  EXPECT_THAT(says(With({"status", "--to", address_}, "")), HasSubstr("--token-file"));
  EXPECT_THAT(says(With({"cancel", "--to", address_}, "read")), HasSubstr("needs the role submit"));
  EXPECT_THAT(says(With({"status", "--to", address_}, "work")), HasSubstr("needs the role read"));
  MakeToken("other", "submit");
  EXPECT_TRUE(Eventually([&] { return RunProgram(With({"status", "--to", address_}, "other")).exit_code == 0; }, 30)) << "no restart is needed";
  EXPECT_THAT(says(With({"cancel", "--to", address_}, "other")), HasSubstr("belongs to submit"));
  EXPECT_EQ(RunProgram(With({"cancel", "--to", address_}, "operate")).exit_code, 0);
  EXPECT_EQ(RunProgram({"status", "--state", state().string()}).exit_code, 0) << "the private door asks this user for nothing";
  EXPECT_NE(RunProgram({"status", "--to", address_, "--tls-ca", certificates_.Certificate("ca"), "--token-file", Token("read")}).exit_code, 0)
      << "without a client certificate";
}

}  // namespace
}  // namespace vorocast::cluster
