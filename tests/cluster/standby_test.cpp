// SPDX-License-Identifier: AGPL-3.0-or-later
// Two schedulers on one PostgreSQL: whatever becomes of the leader or of the database, the job ends with the results of an undisturbed run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <memory>

#include "tests/cluster/farm.h"
#include "tests/cluster/programs.h"
#include "tests/cluster/small_job.h"
#include "tests/support/temporary_postgres.h"

namespace vorocast::cluster {
namespace {

using testing::HasSubstr;

class Standby : public testing::Test {
 protected:
  void SetUp() override {
    database_ = support::TemporaryPostgres::Start();
    if (!database_) GTEST_SKIP() << "PostgreSQL is not installed: deploy/install_packages.sh";
    ASSERT_FALSE(UndisturbedDigests().empty());
    const std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
    farm_ = std::make_unique<Farm>(Farm::Options{.folder = Scratch() / name, .database = database_->Url("farm"), .schedulers = 2});
    job_ = std::make_unique<Running>(farm_->SubmitArguments(SmallCapture(), {"--watch"}));
    ASSERT_TRUE(Eventually([&] { return CountFiles(farm_->state() / "artifacts") >= 3; }));
  }

  void ExpectUndisturbedResults() {
    const Outcome outcome = job_->Wait();
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    EXPECT_EQ(farm_->FetchedDigests(), UndisturbedDigests());
  }

  std::unique_ptr<support::TemporaryPostgres> database_;
  std::unique_ptr<Farm> farm_;
  std::unique_ptr<Running> job_;
};

TEST_F(Standby, TakesOverWhenTheLeaderIsKilledAndGoesOnWhenTheDatabaseWas) {
  const Outcome told = RunProgram({"status", "--to", farm_->scheduler_address(1)});
  EXPECT_THAT(told.output, HasSubstr("the leader is at " + farm_->scheduler_address(0)));
  farm_->member("scheduler-0").Signal(SIGKILL);
  EXPECT_TRUE(Eventually([&] { return farm_->Leads(1); }, 30));
  database_->Kill();
  database_->Restart();
  ExpectUndisturbedResults();
}

TEST_F(Standby, TakesOverWhenTheLeaderIsStoppedAndThatOneStepsDownWhenItWakes) {
  farm_->member("scheduler-0").Signal(SIGSTOP);
  EXPECT_TRUE(Eventually([&] { return farm_->Leads(1); }, 30));
  farm_->member("scheduler-0").Signal(SIGCONT);
  const Outcome fenced = farm_->member("scheduler-0").Wait();
  EXPECT_EQ(fenced.exit_code, 75);
  EXPECT_THAT(fenced.output, HasSubstr("stepping down"));
  EXPECT_THAT(fenced.output, HasSubstr(farm_->scheduler_address(1)));
  ExpectUndisturbedResults();
}

}  // namespace
}  // namespace vorocast::cluster
