// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/attempt_view.h"

#include <fmt/format.h>

namespace vorocast::client {
namespace {

std::string_view OutcomeText(v1::State outcome) {
  switch (outcome) {
    case v1::DONE:
      return "done";
    case v1::FAILED:
      return "failed";
    case v1::CANCELLED:
      return "no longer wanted";
    case v1::RUNNING:
      return "runs";
    default:
      return "unknown";
  }
}

absl::Time TimeOf(double unix_seconds) { return absl::UnixEpoch() + absl::Seconds(unix_seconds); }

}  // namespace

std::string FormatBytes(std::int64_t bytes) {
  constexpr const char* kUnits[] = {"B", "KiB", "MiB", "GiB", "TiB"};
  double value = static_cast<double>(bytes);
  std::size_t unit = 0;
  while (value >= 1000 && unit + 1 < std::size(kUnits)) value /= 1024, ++unit;
  return unit == 0 || value >= 100 ? fmt::format("{:.0f} {}", value, kUnits[unit]) : fmt::format("{:.1f} {}", value, kUnits[unit]);
}

std::string Indented(std::string_view text, std::string_view indent) {
  std::string lines;
  bool begins = true;
  for (const char c : text) {
    if (begins) lines += indent;
    begins = c == '\n';
    const auto byte = static_cast<unsigned char>(c);
    if ((byte < 0x20 && c != '\n' && c != '\t') || byte == 0x7f) {
      lines += "·";
    } else {
      lines.push_back(c);
    }
  }
  if (!begins) lines.push_back('\n');
  return lines;
}

std::string DescribeAttempt(const v1::TaskAttempt& attempt, absl::TimeZone zone) {
  std::string text = fmt::format("{}  attempt {}  {}", absl::FormatTime("%Y-%m-%d %H:%M:%S", TimeOf(attempt.started()), zone), attempt.number(),
                                 OutcomeText(attempt.outcome()));
  if (attempt.ended() > 0) text += fmt::format(" after {:.2f} s", attempt.ended() - attempt.started());
  if (attempt.cpu_seconds() > 0) text += fmt::format(", {:.2f} CPU s", attempt.cpu_seconds());
  if (attempt.memory_peak() > 0) text += fmt::format(", {}", FormatBytes(attempt.memory_peak()));
  text = Indented(fmt::format("{}  {}  worker {}", attempt.task(), text, attempt.worker()), "");
  if (!attempt.cause().empty()) text += Indented(attempt.cause(), "    cause: ");
  if (!attempt.log().empty()) text += Indented(attempt.log(), "    | ");
  return text;
}

}  // namespace vorocast::client
