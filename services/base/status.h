// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace vorocast::base {

/// The same code with "context: " put before the message; OK stays OK. Added once at each boundary.
absl::Status Annotate(const absl::Status& status, std::string_view context);

}  // namespace vorocast::base
// NOLINTBEGIN(bugprone-macro-parentheses): a declaration and a return value cannot stand in parentheses.
/// Returns the status of `expression` from the calling function unless it is OK.
#define RETURN_IF_ERROR(expression)                                         \
  do {                                                                      \
    if (absl::Status status_ = (expression); !status_.ok()) return status_; \
  } while (false)

#define VOROCAST_CONCAT_INNER(a, b) a##b
#define VOROCAST_CONCAT(a, b) VOROCAST_CONCAT_INNER(a, b)
#define VOROCAST_ASSIGN_OR_RETURN(result, target, expression) \
  auto result = (expression);                                 \
  if (!result.ok()) return result.status();                   \
  target = std::move(result).value()

/// ASSIGN_OR_RETURN(auto points, ReadPoints(path)); returns the error, or assigns the value.
#define ASSIGN_OR_RETURN(target, expression) VOROCAST_ASSIGN_OR_RETURN(VOROCAST_CONCAT(status_or_, __LINE__), target, expression)
// NOLINTEND(bugprone-macro-parentheses)
