// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

#include "scheduler/store/store.h"

namespace vorocast::server {

/// Gives the leader's sign of life once a second, and says when another leads: an idle scheduler that was stopped and woken again must find out
/// before somebody asks it.
class LeadershipWatch {
 public:
  /// `store` must outlive this. `lost` is called at most once, from this object's thread.
  LeadershipWatch(store::Store& store, std::function<void(const absl::Status&)> lost);
  ~LeadershipWatch();

 private:
  void Run();

  store::Store& store_;
  const std::function<void(const absl::Status&)> lost_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;  // guarded by mutex_
  std::thread thread_;
};

}  // namespace vorocast::server
