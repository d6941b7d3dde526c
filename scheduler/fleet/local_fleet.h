// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "absl/time/time.h"
#include "scheduler/fleet/fleet.h"
#include "scheduler/fleet/process.h"
#include "services/base/status.h"

namespace vorocast::fleet {

/// One process that the fleet keeps alive.
struct Member {
  std::string name;                    // "worker-1", also of its log
  std::vector<std::string> arguments;  // the program's path first
};

struct FleetOptions {
  std::filesystem::path state;  // fleet.json, logs/NAME.log
  std::vector<Member> members;
  absl::Duration poll = absl::Milliseconds(100);
  absl::Duration stop_grace = absl::Seconds(10);  // between SIGTERM and SIGKILL
};

/// The workers of one machine. They go on when this process is killed, and a fleet started afterwards on the same state folder takes them
/// up again instead of starting a second set. A member that ends is started again, the later the more often it ends soon after its start.
class LocalFleet final : public Fleet {
 public:
  static absl::StatusOr<std::unique_ptr<LocalFleet>> Start(FleetOptions options);
  /// Stops every member.
  ~LocalFleet() override;

  std::string Describe() const override;

  /// How many members were found running at the start.
  std::size_t adopted() const { return adopted_; }

 private:
  struct Kept {
    Member member;
    ProcessId process;
    absl::Time started;
    absl::Time next_start;
    int quick_deaths = 0;
  };
  explicit LocalFleet(FleetOptions options) : options_(std::move(options)) {}
  void Adopt();
  absl::Status Launch(Kept& kept);
  void Restart(Kept& kept);
  absl::Status WriteFile() const;
  void Watch();
  void StopMembers();

  FleetOptions options_;
  std::vector<Kept> kept_;      // guarded by mutex_, once the watching thread runs
  std::vector<ProcessId> old_;  // found running, but no longer wanted
  std::size_t adopted_ = 0;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;  // guarded by mutex_
  std::thread thread_;
};

struct LocalFleetPlan {
  std::filesystem::path programs;  // folder of vorocast-worker and vorocast-simulation
  std::string scheduler;           // address they connect to
  std::int32_t workers = 0;
  bool simulation = false;
};
std::vector<Member> Members(const LocalFleetPlan& plan);

}  // namespace vorocast::fleet
