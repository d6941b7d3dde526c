// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstddef>

namespace vorocast::capture::testing {

/// Forgets what has been seen so far.
void WatchAllocations();
/// Bytes of the largest single request that operator new has got since, from the readers and the libraries below them.
std::size_t LargestAllocation();

}  // namespace vorocast::capture::testing
