// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string_view>

#include "services/base/status.h"

namespace vorocast::capture {

/// Reads a text format line by line without copying it. Lines end in \n or \r\n; blank lines are passed over.
class TextLines {
 public:
  /// A line longer than this is no line of a frame: the file is binary or damaged.
  static constexpr std::size_t kLineMax = 65536;

  /// `comment` starts a comment that runs to the end of its line; '\0': there are none.
  TextLines(std::string_view bytes, char comment) : bytes_(bytes), comment_(comment) {}

  /// The next line that holds something, with its comment cut off; false at the end of the file. INVALID_ARGUMENT for a line beyond kLineMax.
  absl::StatusOr<bool> Next(std::string_view& line);

  /// 1-based number of the line returned last.
  std::int64_t line_number() const { return line_number_; }
  /// Bytes that have not been read.
  std::size_t Remaining() const { return bytes_.size() - position_; }
  /// Offset of the first byte that has not been read.
  std::size_t Position() const { return position_; }

 private:
  std::string_view bytes_;
  char comment_;
  std::size_t position_ = 0;
  std::int64_t line_number_ = 0;
};

/// Takes the next word, separated by blanks, off the front of `line`; empty at its end.
std::string_view TakeWord(std::string_view& line);

/// The whole word as a number, in the C locale; a leading plus, nan and inf are numbers. False for anything else, also for 1e999.
bool ParseNumber(std::string_view word, double& value);
bool ParseInteger(std::string_view word, std::int64_t& value);

}  // namespace vorocast::capture
