// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <functional>
#include <string_view>

namespace vorocast::base {

/// Told now and then how much of a task is done, in [0, 1]. Cheap to call; empty means nobody listens.
using Progress = std::function<void(double fraction)>;

inline void Report(const Progress& progress, double fraction) {
  if (progress) progress(fraction);
}

}  // namespace vorocast::base
