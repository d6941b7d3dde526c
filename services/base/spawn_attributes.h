// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <spawn.h>

namespace vorocast::base {

/// Attributes for posix_spawn of a process that lives on its own: its own process group, so that a terminal's Ctrl-C reaches only its parent; no
/// signal blocked; SIGPIPE, SIGTERM and SIGINT as a program expects them, whatever the parent has made of them.
class SpawnAttributes {
 public:
  SpawnAttributes();
  ~SpawnAttributes();
  SpawnAttributes(const SpawnAttributes&) = delete;
  SpawnAttributes& operator=(const SpawnAttributes&) = delete;

  const posix_spawnattr_t* get() const { return &attributes_; }

 private:
  posix_spawnattr_t attributes_;
};

}  // namespace vorocast::base
