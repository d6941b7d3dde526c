// SPDX-License-Identifier: AGPL-3.0-or-later
// The test program is also the program that it tests the loop with: `execute-task` runs one task, `run-worker ADDRESS` a worker.
#include <signal.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include "services/lease/lease_loop.h"
#include "tests/unit/services/lease/obedient_executor.h"

int main(int argc, char** argv) {
  using namespace vorocast::lease;
  const std::string command = argc > 1 ? argv[1] : "";
  if (command == "execute-task") {
    std::vector<std::unique_ptr<Executor>> executors;
    executors.push_back(std::make_unique<ObedientExecutor>());
    return ExecuteTaskMain(executors);
  }
  if (command == "run-worker") {
    const LeaseLoopOptions options{.scheduler = argv[2], .program = std::filesystem::read_symlink("/proc/self/exe")};
    return RunLeaseLoop(options, {vorocast::tasks::Kind::kSimulate}).ok() ? 0 : 1;
  }
  // The loop under test takes SIGTERM; one that comes when it has just ended is nobody's.
  ::signal(SIGTERM, SIG_IGN);
  ::testing::InitGoogleMock(&argc, argv);
  return RUN_ALL_TESTS();
}
