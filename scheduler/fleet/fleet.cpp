// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/fleet/fleet.h"

namespace vorocast::fleet {

std::string Describe(const std::vector<std::unique_ptr<Fleet>>& fleets) {
  std::string text;
  for (const auto& fleet : fleets) text += (text.empty() ? "" : "; ") + fleet->Describe();
  return text;
}

}  // namespace vorocast::fleet
