// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>

namespace vorocast::rpc {

/// Largest message either way: the task that reads every frame of a long take names thousands of inputs.
inline constexpr int kMessageBytesMax = 64 << 20;
/// Blobs and results travel in pieces of at most this size.
inline constexpr std::int64_t kChunkBytesMax = 1 << 20;
/// Both ends ask for a sign of life this often and give up after as long again: a stopped peer is found within five seconds.
inline constexpr int kKeepaliveMs = 2000;

}  // namespace vorocast::rpc
