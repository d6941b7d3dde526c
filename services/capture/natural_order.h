// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string_view>

namespace vorocast::capture {

/// True when `a` comes before `b` as a person counts: runs of digits compare as numbers, so that frame_2 comes before frame_10.
/// A strict order of all names: those that differ in leading zeros only compare byte by byte.
bool NaturalLess(std::string_view a, std::string_view b);

}  // namespace vorocast::capture
