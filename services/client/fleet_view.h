// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>

#include "absl/time/time.h"
#include "proto/jobs.pb.h"

namespace vorocast::client {

/// Who works, in a line, and a line for each worker that has been set aside; ends with a newline.
std::string DescribeFleet(const v1::Fleet& fleet, absl::TimeZone zone);

}  // namespace vorocast::client
