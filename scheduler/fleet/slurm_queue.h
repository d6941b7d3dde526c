// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "services/base/status.h"

/// What Slurm's programs print, read without belief: a field that is missing, of another type, or in the form of another version makes that one
/// entry count for nothing.
namespace vorocast::fleet {

/// One element of a job array.
struct SlurmMember {
  enum class State : std::uint8_t { kQueued, kUp, kEnding };
  std::int64_t job = 0;   // the array's
  std::int64_t task = 0;  // the element's
  State state = State::kQueued;
  friend bool operator==(const SlurmMember&, const SlurmMember&) = default;
};

/// "12_3", as scancel wants it.
std::string Name(const SlurmMember& member);

/// The members named `job_name` in what `squeue --json` prints, in the order of their numbers. DATA_LOSS when it is not JSON or has no jobs.
absl::StatusOr<std::vector<SlurmMember>> ParseQueue(std::string_view json, std::string_view job_name);

/// "1-4,7,9-13:2%8" as numbers; at most `count_max`, and what cannot be read is passed over.
std::vector<std::int64_t> ParseTaskRanges(std::string_view text, std::size_t count_max);

/// The job's number in what `sbatch --parsable` prints: "12" or "12;cluster". DATA_LOSS for anything else.
absl::StatusOr<std::int64_t> ParseSubmitted(std::string_view text);

}  // namespace vorocast::fleet
