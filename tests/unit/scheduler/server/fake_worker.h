// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "proto/dispatch.grpc.pb.h"
#include "services/storage/artifact_store.h"

namespace vorocast::server {

/// Speaks the whole protocol, but "makes" each result by writing the task's label into a file. Connects again for ever.
class FakeWorker {
 public:
  struct Behaviour {
    std::string name = "fake-1";
    std::int32_t slots = 4;
    /// What to fail with, or empty to succeed; by label. "CRASHED" is tried again, everything else is the input's fault.
    std::function<std::string(const std::string& label)> fails = [](const std::string&) { return std::string(); };
    /// Keeps an attempt instead of finishing it.
    std::function<bool(const std::string& label)> holds = [](const std::string&) { return false; };
  };
  FakeWorker(std::string scheduler, const storage::ArtifactStore& artifacts, Behaviour behaviour);
  ~FakeWorker();

  /// How often each label was executed.
  std::map<std::string, int> executed() const;
  /// Attempts that the last Welcome said to go on with.
  int went_on() const { return went_on_; }
  /// Finishes what was held.
  void Release();

 private:
  void Run();
  void Serve();
  v1::Finished Execute(const v1::Lease& lease);

  const std::string scheduler_;
  const storage::ArtifactStore& artifacts_;
  const Behaviour behaviour_;
  mutable std::mutex mutex_;
  std::map<std::string, int> executed_;             // guarded by mutex_
  std::map<std::string, v1::Finished> unreported_;  // by task and attempt, until acknowledged; guarded by mutex_
  std::map<std::string, v1::Lease> held_;           // guarded by mutex_
  grpc::ClientContext* context_ = nullptr;          // of the stream that is open; guarded by mutex_
  std::atomic<int> went_on_ = 0;
  std::atomic<bool> stopping_ = false;
  std::atomic<bool> released_ = false;
  std::thread thread_;
};

}  // namespace vorocast::server
