// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace vorocast::support {

/// A real Slurm of a test's own on this machine (deploy/slurm), in a temporary folder. Taken down and removed with this object; while it lives,
/// SLURM_CONF leads to it. One at a time in a process.
class SlurmCluster {
 public:
  /// Null when Slurm is not installed. Crashes when it does not come up.
  static std::unique_ptr<SlurmCluster> Start(int nodes, int cpus_a_node);
  ~SlurmCluster();
  SlurmCluster(const SlurmCluster&) = delete;
  SlurmCluster& operator=(const SlurmCluster&) = delete;

  /// Elements of all jobs in this state: "RUNNING", "PENDING".
  int Count(const std::string& state) const;
  /// kill -9 of a node's daemon; its jobs' processes stay for a while.
  void KillNode(int node) const;
  /// kill -9 of the cluster's controller: nothing can be asked or submitted until Repair.
  void KillController() const;
  /// Starts what does not run.
  void Repair() const;

 private:
  void Kill(const std::string& pid_file) const;
  explicit SlurmCluster(std::filesystem::path folder) : folder_(std::move(folder)) {}
  std::filesystem::path folder_;
};

}  // namespace vorocast::support
