// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>

#include <CLI/CLI.hpp>

#include "scheduler/server/collector.h"

namespace vorocast::server {

/// --keep-days, --disk-limit and what goes with them: what of the artifact folder is kept for how long. All of it unless asked otherwise.
class CollectorFlags {
 public:
  void AddTo(CLI::App& program);
  CollectorOptions Parse() const;

 private:
  double keep_days_ = 0;
  std::uint64_t disk_limit_ = 0;
  double keep_hours_ = 24;
  double every_minutes_ = 60;
  double keep_attempts_days_ = 30;
  bool dry_run_ = false;
};

}  // namespace vorocast::server
