// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/time/time.h"
#include "scheduler/fleet/fleet.h"
#include "scheduler/fleet/sizing.h"
#include "scheduler/fleet/slurm_queue.h"
#include "services/base/status.h"

namespace vorocast::fleet {

struct SlurmFleetOptions {
  std::filesystem::path state;            // shared by all machines: slurm/worker.sh, slurm/status.txt, logs/slurm-JOB_TASK.log
  std::string scheduler;                  // what workers connect to, HOST:PORT; several separated by commas
  std::filesystem::path worker;           // vorocast-worker, as the nodes see it
  std::string partition;                  // empty: Slurm's default
  std::vector<std::string> extra;         // further arguments of sbatch: "--account=film"
  std::vector<std::string> worker_extra;  // further arguments of vorocast-worker: "--tls-ca=/farm/ca.pem"
  SizingLimits limits;
  absl::Duration finish_in = absl::Minutes(10);  // when work that begins now should be done
  absl::Duration poll = absl::Seconds(5);
  absl::Duration pause_max = absl::Minutes(5);     // the longest, after many failures
  absl::Duration drain_time = absl::Seconds(20);   // less than Slurm's KillWait
  absl::Duration leave_after = absl::Minutes(10);  // workers whose scheduler has been away so long end
  /// What the scheduler knows now. May fail for a while.
  std::function<absl::StatusOr<Demand>()> demand;
  /// Runs sbatch, scancel, squeue. RunCommand if empty.
  std::function<absl::StatusOr<std::string>(const std::vector<std::string>&)> run;
};

/// Long-lived workers as elements of job arrays on a Slurm cluster. All carry one job name, which stands for the state folder, so that a scheduler
/// which takes over finds those of the one before. Slurm's word counts for how many there are and will be, and for nothing else. When Slurm does
/// not answer, it says so in the log and in slurm/status.txt, nothing is asked for or drained, and the pauses between attempts grow.
class SlurmFleet final : public Fleet {
 public:
  /// UNAVAILABLE when the state folder cannot be written. Whether Slurm answers does not matter.
  static absl::StatusOr<std::unique_ptr<SlurmFleet>> Start(SlurmFleetOptions options);
  /// Workers stay: the next scheduler on this state folder takes them up, and without one they leave by themselves.
  ~SlurmFleet() override;

  std::string Describe() const override;

 private:
  explicit SlurmFleet(SlurmFleetOptions options);
  absl::Status WriteScript() const;
  void Watch();
  /// One look at the queue and what follows from it.
  absl::Status Round();
  double SecondsLeft(const Demand& demand, absl::Time now);
  absl::Status Ask(std::int32_t workers);
  absl::Status Withdraw(std::vector<SlurmMember> queued, std::int32_t count);
  absl::Status Drain(const std::vector<SlurmMember>& up, const Demand& demand, std::int32_t count);
  absl::StatusOr<std::string> Run(const std::vector<std::string>& arguments) const { return options_.run(arguments); }
  void Note(const absl::Status& status, absl::Duration pause);
  void WriteStatus();

  const SlurmFleetOptions options_;
  const std::string job_name_;
  // The watching thread's.
  std::optional<absl::Time> deadline_;  // of the work that there is
  std::string written_;                 // into status.txt
  std::optional<absl::Time> surplus_since_;
  absl::Time next_ask_ = absl::InfinitePast();
  absl::Duration ask_pause_;
  bool waiting_for_first_ = false;  // asked, and no worker has connected since

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;  // guarded by mutex_
  std::string counts_;     // guarded by mutex_; "3 workers up, 2 queued"
  std::string trouble_;    // guarded by mutex_; empty while all is well
  std::thread thread_;
};

/// The name that all workers of a state folder have in Slurm.
std::string SlurmJobName(const std::filesystem::path& state);
/// The name that a worker gives the scheduler, without the count of its restarts: "slurm-12_3-".
std::string WorkerNamePrefix(const SlurmMember& member);

}  // namespace vorocast::fleet
