// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/lease_flags.h"

#include <filesystem>

namespace vorocast::lease {

void LeaseFlags::AddTo(CLI::App& program, LeaseLoopOptions& options, const std::string& slots_help) {
  drain_s_ = absl::ToDoubleSeconds(options.drain_time);
  program.add_option("--slots", options.slots, slots_help)->check(CLI::Range(1, kSlotsMax))->capture_default_str();
  program.add_option("--name", options.name, "Name among the workers; host, process number and start time if not given");
  program.add_option("--drain-time", drain_s_, "Seconds that running tasks get after SIGTERM before they are given back")
      ->check(CLI::Range(0.0, 86400.0))
      ->capture_default_str();
  program.add_option("--leave-after", leave_after_s_, "Leaves by itself when the scheduler has been away for so many seconds (0: never)")
      ->check(CLI::Range(0.0, 1e7))
      ->capture_default_str();
}

void LeaseFlags::Apply(LeaseLoopOptions& options) const {
  std::error_code error;
  options.program = std::filesystem::read_symlink("/proc/self/exe", error);
  options.drain_time = absl::Seconds(drain_s_);
  if (leave_after_s_ > 0) options.leave_after = absl::Seconds(leave_after_s_);
}

}  // namespace vorocast::lease
