// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <functional>
#include <mutex>
#include <string>
#include <utility>

namespace vorocast::server {

/// What is told of where workers come from. Whoever provides them starts after the services do and ends before them.
class FleetNote {
 public:
  void Set(std::function<std::string()> describe) {
    const std::lock_guard lock(mutex_);
    describe_ = std::move(describe);
  }
  std::string Text() const {
    const std::lock_guard lock(mutex_);
    return describe_ ? describe_() : std::string();
  }

 private:
  mutable std::mutex mutex_;
  std::function<std::string()> describe_;  // guarded by mutex_
};

}  // namespace vorocast::server
