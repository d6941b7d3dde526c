// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/lease_flags.h"

#include <cstdlib>
#include <filesystem>

namespace vorocast::lease {
namespace {

std::filesystem::path DefaultCache() {
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache && *cache) return std::filesystem::path(cache) / "vorocast-worker";
  if (const char* home = std::getenv("HOME"); home && *home) return std::filesystem::path(home) / ".cache" / "vorocast-worker";
  return std::filesystem::temp_directory_path() / "vorocast-worker";
}

}  // namespace

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
  program
      .add_option("--artifacts", artifacts_,
                  "How inputs come and results go: shared, through the artifact folder that the scheduler names; or remote, through the scheduler")
      ->check(CLI::IsMember({"shared", "remote"}))
      ->envname("VOROCAST_ARTIFACTS")
      ->capture_default_str();
  program.add_option("--cache", cache_, "With --artifacts remote: folder for what has come and what was made (~/.cache/vorocast-worker)")
      ->envname("VOROCAST_CACHE");
  program.add_option("--cache-limit", cache_limit_gib_, "GiB of it; what was used longest ago goes first, never what is in use")
      ->check(CLI::Range(0.001, 1e6))
      ->envname("VOROCAST_CACHE_LIMIT")
      ->capture_default_str();
  security_.AddTo(program);
}

void LeaseFlags::Apply(LeaseLoopOptions& options) const {
  std::error_code error;
  options.program = std::filesystem::read_symlink("/proc/self/exe", error);
  options.security = security_.Get();
  options.artifacts_remote = artifacts_ == "remote";
  options.cache = cache_.empty() ? DefaultCache() : std::filesystem::path(cache_);
  options.cache_limit = static_cast<std::int64_t>(cache_limit_gib_ * static_cast<double>(1 << 30));
  options.drain_time = absl::Seconds(drain_s_);
  if (leave_after_s_ > 0) options.leave_after = absl::Seconds(leave_after_s_);
}

}  // namespace vorocast::lease
