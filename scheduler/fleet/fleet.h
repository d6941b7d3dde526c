// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <memory>
#include <string>
#include <vector>

namespace vorocast::fleet {

/// What provides a scheduler with workers. It has a thread of its own, and whatever breaks in it never reaches the scheduler: which task is
/// whose is told by the workers' leases alone.
class Fleet {
 public:
  virtual ~Fleet() = default;
  /// How it stands, in one sentence for people: the workers it has, and what is wrong if anything is. From any thread, at once.
  virtual std::string Describe() const = 0;
};

/// All of them, one after the other; empty if there is none.
std::string Describe(const std::vector<std::unique_ptr<Fleet>>& fleets);

}  // namespace vorocast::fleet
