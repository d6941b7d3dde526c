// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "services/base/random.h"
#include "tests/fuzz/subject.h"

namespace vorocast::fuzz {

/// A numeral that readers stumble over: the ends of every integer type, what no double holds, what is none.
std::string AwkwardNumeral(base::Random& random);
/// The same for a field of `bits` bits.
std::uint64_t AwkwardInteger(base::Random& random);
double AwkwardDouble(base::Random& random);

/// One to four random changes of `input`, at most `size_max` bytes long; `others` lend parts. Equal seeds make equal changes.
std::string Mutate(std::string input, const std::vector<std::string>& others, Form form, std::size_t size_max, base::Random& random);

}  // namespace vorocast::fuzz
