// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

namespace vorocast::rpc {

/// Largest message either way: the task that reads every frame of a long take names thousands of inputs.
inline constexpr int kMessageBytesMax = 64 << 20;
/// Blobs and results travel in pieces of at most this size.
inline constexpr std::int64_t kChunkBytesMax = 1 << 20;
/// Both ends ask for a sign of life this often and give up after as long again: a stopped peer is found within five seconds.
inline constexpr int kKeepaliveMs = 2000;
/// Calls at once through one connection; more wait on the client's side.
inline constexpr int kStreamsMax = 1000;
/// What a call may send besides its messages.
inline constexpr int kMetadataBytesMax = 16 << 10;
/// Of all connections of a server together; beyond it gRPC reads no faster than calls are worked off.
inline constexpr std::size_t kServerBufferBytes = std::size_t{1} << 30;
/// Of calls that each hold a thread of a server.
inline constexpr int kServerThreadsMax = 256;

}  // namespace vorocast::rpc
