// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace vorocast::server {

/// A few threads for work that waits for the disk, which must hold up neither the engine nor gRPC's own threads.
/// Every call has at most one piece of work here, so the queue is bounded by the calls under way.
class DiskThreads {
 public:
  explicit DiskThreads(int count);
  /// Works off what is queued.
  ~DiskThreads();
  void Run(std::function<void()> work);

 private:
  void Loop();
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> queue_;  // guarded by mutex_
  bool stopping_ = false;                    // guarded by mutex_
  std::vector<std::thread> threads_;
};

}  // namespace vorocast::server
