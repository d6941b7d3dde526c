// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "scheduler/core/effects.h"
#include "scheduler/core/event.h"
#include "scheduler/store/store.h"
#include "services/storage/artifact_store.h"

namespace vorocast::server {

/// Answers whether results exist: on record and as a file. A file without a record (its report was lost) is taken up; a record without
/// its file, or with a file of another size, is not believed.
class LookUpThread {
 public:
  using Answers = std::function<void(std::vector<core::LookUpAnswered>)>;
  LookUpThread(store::Store& store, const storage::ArtifactStore& artifacts, Answers answers);
  ~LookUpThread();

  void Ask(std::vector<core::LookUp> look_ups);

 private:
  void Run();
  core::LookUpAnswered Answer(const core::LookUp& look_up) const;

  store::Store& store_;
  const storage::ArtifactStore& artifacts_;
  Answers answers_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<core::LookUp> asked_;  // guarded by mutex_
  bool stopping_ = false;           // guarded by mutex_
  std::thread thread_;
};

}  // namespace vorocast::server
