// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

namespace vorocast::base {

/// False, with a message on standard error, when this processor lacks the instruction set the programs were built for
/// (CMake's VOROCAST_MARCH). Called first in every main, where otherwise the first vector instruction would end the program.
bool CheckProcessor();

}  // namespace vorocast::base
