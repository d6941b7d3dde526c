// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <signal.h>

#include <optional>
#include <string>

#include "scheduler/store/store.h"
#include "services/base/status.h"
#include "services/rpc/security.h"

namespace vorocast::server {

/// Waits until `store` leads, and tells everybody who calls `listen` meanwhile where the leader is. Returns the address to listen on from then on
/// (the one asked for, with the port that was chosen); nothing when one of the blocked signals came first. A database that is away is waited for.
/// FAILED_PRECONDITION when a newer version wrote the store, UNAVAILABLE when the address is taken.
absl::StatusOr<std::optional<std::string>> AwaitLeadership(store::Store& store, const std::string& listen, const rpc::ServerGuard& guard,
                                                           const sigset_t& stop_signals);

/// The address under which others reach what listens there: this host's name in place of all its addresses.
std::string AddressForOthers(const std::string& listen);

}  // namespace vorocast::server
