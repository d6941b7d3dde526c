// SPDX-License-Identifier: AGPL-3.0-or-later
// Two schedulers on one PostgreSQL: whatever becomes of the leader or of the database, the job ends with the results of an undisturbed run.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>

#include <fmt/format.h>

#include "services/base/check.h"
#include "tests/cluster/programs.h"
#include "tests/cluster/small_job.h"
#include "tests/support/temporary_postgres.h"

namespace vorocast::cluster {
namespace {

using testing::HasSubstr;

/// A port that was free a moment ago: the workers must know both addresses before either scheduler listens.
int FreePort() {
  const int socket_file = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
  socklen_t size = sizeof address;
  VOROCAST_CHECK(bind(socket_file, reinterpret_cast<sockaddr*>(&address), size) == 0);
  VOROCAST_CHECK(getsockname(socket_file, reinterpret_cast<sockaddr*>(&address), &size) == 0);
  close(socket_file);
  return ntohs(address.sin_port);
}

class Standby : public testing::Test {
 protected:
  void SetUp() override {
    database_ = support::TemporaryPostgres::Start();
    if (!database_) GTEST_SKIP() << "PostgreSQL is not installed: deploy/install_packages.sh";
    ASSERT_FALSE(UndisturbedDigests().empty());
    folder_ = Scratch() / testing::UnitTest::GetInstance()->current_test_info()->name();
    for (std::string& address : addresses_) address = fmt::format("127.0.0.1:{}", FreePort());
    schedulers_[0] = Scheduler(0);
    ASSERT_TRUE(Eventually([&] { return SchedulerPid(state()) == schedulers_[0]->pid(); }, 30));
    schedulers_[1] = Scheduler(1);
    const std::string both = addresses_[0] + "," + addresses_[1];
    for (int i = 0; i < 2; ++i) workers_.push_back(std::make_unique<Running>(std::vector<std::string>{"--scheduler", both}, "vorocast-worker"));
    workers_.push_back(std::make_unique<Running>(std::vector<std::string>{"--scheduler", both}, "vorocast-simulation"));
    job_ = std::make_unique<Running>(std::vector<std::string>{"submit", SmallCapture().string(), "--to", both, "--watch", "--cells", "400",
                                                              "--patches", "30", "--template", "0", "--no-sheets", "--effect", "calm"});
    ASSERT_TRUE(Eventually([&] { return CountFiles(state() / "artifacts") >= 3; }));
  }

  std::filesystem::path state() const { return folder_ / "state"; }
  std::unique_ptr<Running> Scheduler(int which) {
    return std::make_unique<Running>(
        std::vector<std::string>{"--state", state().string(), "--database", database_->Url("farm"), "--listen", addresses_[which]},
        "vorocast-scheduler");
  }
  bool SecondLeads() const { return SchedulerPid(state()) == schedulers_[1]->pid(); }
  void ExpectUndisturbedResults() {
    const Outcome outcome = job_->Wait();
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    const Outcome fetched = RunProgram({"fetch", "--to", addresses_[0] + "," + addresses_[1], "--out", (folder_ / "out").string()});
    EXPECT_EQ(fetched.exit_code, 0) << fetched.output;
    EXPECT_EQ(Digests(folder_ / "out"), UndisturbedDigests());
  }

  std::unique_ptr<support::TemporaryPostgres> database_;
  std::filesystem::path folder_;
  std::string addresses_[2];
  std::unique_ptr<Running> schedulers_[2];
  std::vector<std::unique_ptr<Running>> workers_;
  std::unique_ptr<Running> job_;
};

TEST_F(Standby, TakesOverWhenTheLeaderIsKilledAndGoesOnWhenTheDatabaseWas) {
  const Outcome told = RunProgram({"status", "--to", addresses_[1]});
  EXPECT_THAT(told.output, HasSubstr("the leader is at " + addresses_[0]));
  schedulers_[0]->Signal(SIGKILL);
  EXPECT_TRUE(Eventually([&] { return SecondLeads(); }, 30));
  database_->Kill();
  database_->Restart();
  ExpectUndisturbedResults();
}

TEST_F(Standby, TakesOverWhenTheLeaderIsStoppedAndThatOneStepsDownWhenItWakes) {
  schedulers_[0]->Signal(SIGSTOP);
  EXPECT_TRUE(Eventually([&] { return SecondLeads(); }, 30));
  schedulers_[0]->Signal(SIGCONT);
  const Outcome fenced = schedulers_[0]->Wait();
  EXPECT_EQ(fenced.exit_code, 75);
  EXPECT_THAT(fenced.output, HasSubstr("stepping down"));
  EXPECT_THAT(fenced.output, HasSubstr(addresses_[1]));
  ExpectUndisturbedResults();
}

}  // namespace
}  // namespace vorocast::cluster
