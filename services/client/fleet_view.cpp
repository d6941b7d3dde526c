// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/fleet_view.h"

#include <fmt/format.h>

#include "services/client/attempt_view.h"

namespace vorocast::client {

std::string DescribeFleet(const v1::Fleet& fleet, absl::TimeZone zone) {
  std::string text = fleet.workers() == 0 ? std::string("No worker is connected")
                                          : fmt::format("{} {} connected, {} of {} slots busy", fleet.workers(),
                                                        fleet.workers() == 1 ? "worker" : "workers", fleet.busy(), fleet.slots());
  if (!fleet.description().empty()) text += fmt::format(" ({})", fleet.description());
  text = Indented(text, "");
  for (const v1::SetAside& aside : fleet.set_aside()) {
    const std::string until = absl::FormatTime("%H:%M:%S", absl::UnixEpoch() + absl::Seconds(aside.until()), zone);
    text += Indented(fmt::format("set aside until {}: {}: {}", until, aside.worker(), aside.reason()), "  ");
  }
  return text;
}

}  // namespace vorocast::client
