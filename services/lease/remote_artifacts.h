// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "proto/artifacts.grpc.pb.h"
#include "services/base/digest.h"
#include "services/base/status.h"
#include "services/lease/artifact_cache.h"
#include "services/lease/child_process.h"
#include "services/rpc/security.h"
#include "services/tasks/task.h"

namespace vorocast::lease {

struct RemoteArtifactsOptions {
  std::string scheduler;  // as in LeaseLoopOptions
  rpc::ClientSecurity security;
  std::filesystem::path cache;
  std::int64_t cache_limit = std::int64_t{20} << 30;  // bytes
  absl::Duration patience = absl::Minutes(10);        // a transfer that fails is tried again for so long
};

/// What stands in for the shared artifact folder on a worker that does not see it: a cache that inputs are brought into and from which results are
/// delivered (proto/artifacts.proto). Used by several attempts at once.
class RemoteArtifacts {
 public:
  static absl::StatusOr<std::unique_ptr<RemoteArtifacts>> Open(const RemoteArtifactsOptions& options);

  const storage::ArtifactStore& store() const { return cache_.store(); }

  /// Brings a task's inputs into the cache; they stay there while the holds live. Errors: NOT_FOUND without one of them, DATA_LOSS when it keeps
  /// arriving with other bytes than it should have, UNAVAILABLE when the scheduler or the cache's disk is not to be had, CANCELLED when stopped.
  absl::StatusOr<std::vector<ArtifactCache::Hold>> Bring(const tasks::TaskSpec& spec, const StopFlag& stop);
  /// Puts the result that has been published in the cache. When another is in place already, that one is brought instead: of two attempts the first
  /// result stays.
  absl::Status Deliver(const base::Digest& key, std::string_view extension, const StopFlag& stop);

 private:
  RemoteArtifacts(const RemoteArtifactsOptions& options, ArtifactCache cache) : options_(options), cache_(std::move(cache)) {}

  absl::StatusOr<ArtifactCache::Hold> BringOne(const v1::ArtifactName& name, const StopFlag& stop);
  absl::StatusOr<ArtifactCache::Hold> GetOnce(v1::Artifacts::Stub& scheduler, const v1::ArtifactName& name, const StopFlag& stop);
  absl::Status PutOnce(v1::Artifacts::Stub& scheduler, const v1::PutArtifactChunk& first, const std::filesystem::path& file, const StopFlag& stop);
  /// Calls until it succeeds, fails for good, or patience is over; the schedulers in turn.
  absl::Status Retry(const StopFlag& stop, const std::function<absl::Status(v1::Artifacts::Stub&)>& call);
  std::filesystem::path PathOf(const v1::ArtifactName& name) const;

  const RemoteArtifactsOptions options_;
  ArtifactCache cache_;
  std::vector<std::unique_ptr<v1::Artifacts::Stub>> schedulers_;
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::set<std::filesystem::path> coming_;  // guarded by mutex_: what one attempt fetches, others wait for
};

}  // namespace vorocast::lease
