// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>

#include <CLI/CLI.hpp>

#include "services/lease/lease_loop.h"
#include "services/rpc/security_flags.h"

namespace vorocast::lease {

/// --slots, --name, --drain-time, --leave-after, --artifacts, --cache and how to connect: what every program that takes leases lets its user choose.
class LeaseFlags {
 public:
  /// `slots_help` says what a slot is; `options` gives the defaults and must outlive the parsing.
  void AddTo(CLI::App& program, LeaseLoopOptions& options, const std::string& slots_help);
  /// After parsing: fills in what is kept in other units, and this program's own path.
  void Apply(LeaseLoopOptions& options) const;

 private:
  double drain_s_ = 0;
  double leave_after_s_ = 0;
  rpc::ClientSecurityFlags security_;
  std::string artifacts_ = "shared";
  std::string cache_;
  double cache_limit_gib_ = 20;
};

}  // namespace vorocast::lease
