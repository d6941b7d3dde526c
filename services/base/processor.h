// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

namespace vorocast::base {

/// Ends the program with a message when this processor lacks the instruction set that it was built for (CMake's VOROCAST_MARCH), where
/// otherwise the first vector instruction would end it without one. Called in every main; the check itself runs before main.
void RequireProcessor();

}  // namespace vorocast::base
