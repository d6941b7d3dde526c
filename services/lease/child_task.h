// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "services/base/status.h"
#include "services/tasks/task.h"

/// What a worker and the child process that runs one task say to each other: one JSON object to the child's standard input, then JSON lines from
/// its standard output, {"progress": 0.25} any number of times and {"code": 0, "message": ""} once, last.
namespace vorocast::lease {

struct ChildTask {
  tasks::TaskSpec spec;
  std::filesystem::path store_root;
  std::filesystem::path output;
  std::int64_t memory_limit = 0;  // bytes; 0: none
  std::int64_t worker_pid = 0;
};
std::string Encode(const ChildTask& task);
absl::StatusOr<ChildTask> DecodeChildTask(std::string_view text);

struct ChildLine {
  std::optional<double> progress;
  std::optional<absl::Status> outcome;
};
std::string EncodeProgress(double fraction);
std::string EncodeOutcome(const absl::Status& status);
/// A line that is neither has neither: a library may have printed it.
ChildLine DecodeChildLine(std::string_view line);

/// Valid UTF-8 of at most `bytes_max` bytes, whatever the text was; cut at the front or the end with an ellipsis.
std::string TextForPeople(std::string_view text, std::size_t bytes_max);
std::string TailForPeople(std::string_view text, std::size_t bytes_max);
inline constexpr std::size_t kMessageBytesMax = 4000;
inline constexpr std::size_t kLogBytesMax = 64 << 10;

}  // namespace vorocast::lease
