// SPDX-License-Identifier: AGPL-3.0-or-later
// Everything at once, at random moments of a real job: whoever is killed or stopped, the results are those of an undisturbed run.
// VOROCAST_CHAOS_SEED=7 repeats what one seed chose (the moments are the machine's), VOROCAST_CHAOS_ROUNDS=100 plays on.
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "services/base/random.h"
#include "tests/cluster/farm.h"
#include "tests/cluster/programs.h"
#include "tests/cluster/small_job.h"
#include "tests/support/temporary_postgres.h"

namespace vorocast::cluster {
namespace {

using std::chrono::milliseconds;

/// Faults end after so many, so that the job must end by itself then.
constexpr int kFaults = 14;

std::uint64_t NumberFrom(const char* variable, std::uint64_t otherwise) {
  const char* text = std::getenv(variable);
  return text ? std::strtoull(text, nullptr, 10) : otherwise;
}

/// Kills or stops one process after another until the job has ended or enough has happened; nothing stays stopped.
class Chaos {
 public:
  Chaos(Farm& farm, support::TemporaryPostgres& database, std::uint64_t seed) : farm_(farm), database_(database), random_(seed) {}

  void Play(Running& job) {
    for (int i = 0; i < kFaults && !job.HasEnded(); ++i) {
      std::this_thread::sleep_for(milliseconds(50 + random_.Below(500)));
      Strike();
      farm_.Revive();
    }
  }
  const std::string& story() const { return story_; }

 private:
  void Strike() {
    const std::vector<std::string> names = farm_.names();
    const std::size_t victim = random_.Below(names.size() + 1);
    const milliseconds pause(random_.Below(6) == 0 ? 11'000 : 100 + random_.Below(1500));  // the long one outlasts a lease
    const bool kills = random_.Below(2) == 0;
    if (victim == names.size()) {
      story_ += "postgres killed\n";
      database_.Kill();
      std::this_thread::sleep_for(pause / 10);
      database_.Restart();
      return;
    }
    Running& process = farm_.member(names[victim]);
    if (process.HasEnded()) return;
    story_ += fmt::format("{} {}\n", names[victim], kills ? "killed" : fmt::format("stopped for {} ms", pause.count()));
    process.Signal(kills ? SIGKILL : SIGSTOP);
    if (kills) {
      Eventually([&] { return process.HasEnded(); });
    } else {
      std::this_thread::sleep_for(pause);
      process.Signal(SIGCONT);
    }
  }

  Farm& farm_;
  support::TemporaryPostgres& database_;
  base::Random random_;
  std::string story_;
};

TEST(Chaos, ResultsAreThoseOfAnUndisturbedRunWhateverIsKilledOrStopped) {
  const auto database = support::TemporaryPostgres::Start();
  if (!database) GTEST_SKIP() << "PostgreSQL is not installed: deploy/install_packages.sh";
  ASSERT_FALSE(UndisturbedDigests().empty());
  const std::uint64_t first = NumberFrom("VOROCAST_CHAOS_SEED", 1);
  for (std::uint64_t seed = first; seed < first + NumberFrom("VOROCAST_CHAOS_ROUNDS", 2); ++seed) {
    const std::string name = fmt::format("chaos{}", seed);
    Farm farm({.folder = Scratch() / name, .database = database->Url(name), .schedulers = 2});
    Running job(farm.SubmitArguments(SmallCapture(), {"--watch"}));
    Chaos chaos(farm, *database, seed);
    chaos.Play(job);
    // A scheduler that steps down, or found the database away, ends and is started again until the job has ended.
    EXPECT_TRUE(Eventually([&] {
      farm.Revive();
      return job.HasEnded();
    })) << "seed "
        << seed << "\n"
        << chaos.story();
    const Outcome outcome = job.Wait();
    EXPECT_EQ(outcome.exit_code, 0) << "seed " << seed << "\n" << chaos.story() << outcome.output;
    EXPECT_EQ(farm.FetchedDigests(), UndisturbedDigests()) << "seed " << seed << "\n" << chaos.story();
    if (HasFailure()) return;
  }
}

}  // namespace
}  // namespace vorocast::cluster
