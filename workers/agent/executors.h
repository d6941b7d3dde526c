// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "services/lease/executor.h"

namespace vorocast::agent {

/// One executor for every kind of task that a worker takes: all but simulations, which vorocast-simulation takes.
std::vector<std::unique_ptr<lease::Executor>> AllExecutors();

}  // namespace vorocast::agent
