// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>

#include "services/base/random.h"

namespace vorocast::fuzz {

/// One change of a JSON text that leaves it JSON, mostly: a value replaced by an awkward one or by a part of `other`, removed, doubled, a field
/// renamed, a value nested very deep. Anything else than JSON comes back as it is.
std::string MutateJson(const std::string& text, const std::string& other, base::Random& random);

}  // namespace vorocast::fuzz
