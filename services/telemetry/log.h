// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "services/base/status.h"

/// How a service logs. Messages read "what happened: key=value key=\"value with spaces\""; as JSON each becomes one object a line with the time,
/// level, process and message, and of its keys those that say what it is about: job, task, attempt, worker.
namespace vorocast::telemetry {

struct LogOptions {
  std::string process;          // "scheduler"
  std::string format = "text";  // or "json"
  std::string level = "info";   // "debug", "info", "warn", "error"
  std::filesystem::path file;   // besides standard error; empty: none
};

/// From here on spdlog's default logger writes as asked for. INVALID_ARGUMENT for another format or level; UNAVAILABLE when the file cannot be
/// written.
absl::Status StartLog(const LogOptions& options);

/// The JSON object, without a newline, of one message. Bytes that are not UTF-8 are replaced.
std::string LogLineAsJson(std::string_view time, std::string_view level, std::string_view process, std::string_view message);

}  // namespace vorocast::telemetry
