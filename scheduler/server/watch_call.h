// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include <grpcpp/support/server_callback.h>

#include "proto/jobs.pb.h"
#include "scheduler/server/catalogue.h"
#include "scheduler/server/engine.h"
#include "services/base/status.h"

namespace vorocast::server {

/// One client's view of a job. A slow client gets fewer messages, never older ones.
class WatchCall final : public grpc::ServerWriteReactor<v1::Job>, public std::enable_shared_from_this<WatchCall> {
 public:
  /// Keeps itself alive until gRPC is done with it.
  static std::shared_ptr<WatchCall> Make();

  /// `last`: the call ends after this one.
  void Push(v1::Job job, bool last);
  void End(const absl::Status& status);
  bool has_ended();

  void OnWriteDone(bool ok) override;
  void OnCancel() override { End(absl::CancelledError("the client has gone")); }
  void OnDone() override { self_.reset(); }

 private:
  void WriteNext();  // with mutex_ held

  std::shared_ptr<WatchCall> self_;
  std::mutex mutex_;
  v1::Job writing_;
  std::optional<v1::Job> next_;  // guarded by mutex_
  bool is_writing_ = false;      // guarded by mutex_
  bool last_pushed_ = false;     // guarded by mutex_
  bool ended_ = false;           // guarded by mutex_
};

/// Who watches which job; touched only inside turns, but for its calls.
class Watchers {
 public:
  explicit Watchers(const Catalogue& catalogue) : catalogue_(catalogue) {}

  /// The job as it is now, and from then on its changes.
  void Add(Turn& turn, const CatalogueJob& job, std::shared_ptr<WatchCall> call);
  /// Called every turn; sends each job at most five times a second.
  void Changed(Turn& turn, const std::set<std::string>& jobs);
  void EndAll(const absl::Status& status);

 private:
  struct Watched {
    std::vector<std::shared_ptr<WatchCall>> calls;
    bool changed = false;
    absl::Time sent = absl::InfinitePast();
  };
  void Send(Turn& turn, const std::string& id, Watched& watched);

  const Catalogue& catalogue_;
  std::map<std::string, Watched> jobs_;
};

}  // namespace vorocast::server
