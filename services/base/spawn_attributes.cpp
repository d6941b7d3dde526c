// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/base/spawn_attributes.h"

#include <signal.h>

#include <initializer_list>

namespace vorocast::base {

SpawnAttributes::SpawnAttributes() {
  posix_spawnattr_init(&attributes_);
  posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  posix_spawnattr_setpgroup(&attributes_, 0);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes_, &none);
  sigset_t standard;
  sigemptyset(&standard);
  for (const int signal : {SIGPIPE, SIGTERM, SIGINT}) sigaddset(&standard, signal);
  posix_spawnattr_setsigdefault(&attributes_, &standard);
}

SpawnAttributes::~SpawnAttributes() { posix_spawnattr_destroy(&attributes_); }

}  // namespace vorocast::base
