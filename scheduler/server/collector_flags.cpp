// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/collector_flags.h"

namespace vorocast::server {
namespace {

constexpr char kGroup[] = "What is kept";
constexpr double kDaysMax = 36500;

}  // namespace

void CollectorFlags::AddTo(CLI::App& program) {
  program.add_option("--keep-days", keep_days_, "Captured frames and results that nobody has used for so many days are removed (0: never)")
      ->check(CLI::Range(0.0, kDaysMax))
      ->capture_default_str()
      ->group(kGroup);
  program
      .add_option("--disk-limit", disk_limit_,
                  "Above this many bytes, as in 500G or 2T, those that were used longest ago are removed, never one that an unfinished job reads (0: "
                  "no limit)")
      ->transform(CLI::AsSizeValue(false))
      ->group(kGroup);
  program.add_option("--keep-hours", keep_hours_, "What was used in these last hours stays in any case")
      ->check(CLI::Range(0.1, 24 * kDaysMax))
      ->capture_default_str()
      ->group(kGroup);
  program.add_option("--collect-every", every_minutes_, "Minutes between looks at the artifact folder")
      ->check(CLI::Range(0.1, 1440.0))
      ->capture_default_str()
      ->group(kGroup);
  program.add_flag("--collect-dry-run", dry_run_, "Only log what would be removed")->group(kGroup);
  program
      .add_option("--keep-attempts-days", keep_attempts_days_,
                  "What became of ended jobs' attempts, and what they printed, is kept so long (0: for ever)")
      ->check(CLI::Range(0.0, kDaysMax))
      ->capture_default_str()
      ->group(kGroup);
}

CollectorOptions CollectorFlags::Parse() const {
  CollectorOptions options;
  if (keep_days_ > 0) options.policy.keep = absl::Hours(24 * keep_days_);
  options.policy.disk_limit = static_cast<std::int64_t>(disk_limit_);
  options.policy.keep_at_least = absl::Hours(keep_hours_);
  options.every = absl::Minutes(every_minutes_);
  options.keep_attempts = keep_attempts_days_ > 0 ? absl::Hours(24 * keep_attempts_days_) : absl::InfiniteDuration();
  options.dry_run = dry_run_;
  return options;
}

}  // namespace vorocast::server
