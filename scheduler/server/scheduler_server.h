// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include <prometheus/registry.h>

#include "scheduler/fleet/sizing.h"
#include "scheduler/server/collector.h"
#include "scheduler/store/store.h"
#include "services/base/status.h"
#include "services/rpc/security.h"

namespace vorocast::server {

struct SchedulerOptions {
  std::filesystem::path state;  // holds the artifact folder, and scheduler.db unless the state is kept elsewhere
  std::string listen;           // host:port or unix:/path
  rpc::ServerGuard guard;       // by default nobody is asked who they are
  CollectorOptions collection;
  /// Told, from any thread, when this scheduler must not go on: another leads, or its store is damaged. By default the process ends.
  std::function<void(const absl::Status&)> lost;
};

/// The exit code of a scheduler that has stepped down: start it again, and it stands by.
inline constexpr int kSteppedDown = 75;

/// A whole scheduler: its memory, its core and its three services. Goes on from what the state folder remembers.
class SchedulerServer {
 public:
  /// Errors: FAILED_PRECONDITION when another scheduler serves the folder, DATA_LOSS for a damaged database, UNAVAILABLE for an address
  /// that is taken.
  static absl::StatusOr<std::unique_ptr<SchedulerServer>> Start(const SchedulerOptions& options);
  /// With a store that leads already.
  static absl::StatusOr<std::unique_ptr<SchedulerServer>> Start(const SchedulerOptions& options, std::unique_ptr<store::Store> store);
  /// Ends all calls, works off what has come in, and makes it durable. Workers keep what they hold.
  ~SchedulerServer();

  const std::string& address() const;
  /// For processes of this user on this machine, which need neither certificate nor token there.
  const std::string& address_here() const;
  /// What is left to do, for whoever provides workers. From any thread; UNAVAILABLE while the store cannot be written, or when it takes too long.
  absl::StatusOr<fleet::Demand> Demand() const;
  /// How who lists jobs is told where workers come from; called from any thread. Nothing: nobody manages them.
  void DescribeFleet(std::function<std::string()> describe);
  const std::shared_ptr<prometheus::Registry>& metrics() const;
  /// One round of collection, now rather than at its time.
  absl::StatusOr<CollectionPlan> Collect();

 private:
  struct Parts;
  explicit SchedulerServer(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace vorocast::server
