// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/text_lines.h"

#include <fmt/format.h>

#include <charconv>

namespace vorocast::capture {
namespace {

constexpr std::string_view kBlanks = " \t\v\f\r";

template <typename T>
bool ParseWhole(std::string_view word, T& value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);  // from_chars takes no plus
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc() && end == word.data() + word.size();
}

}  // namespace

absl::StatusOr<bool> TextLines::Next(std::string_view& line) {
  while (position_ < bytes_.size()) {
    const std::size_t end = std::min(bytes_.find('\n', position_), bytes_.size());
    line = bytes_.substr(position_, end - position_);
    position_ = std::min(end + 1, bytes_.size());
    ++line_number_;
    if (line.size() > kLineMax) {
      return absl::InvalidArgumentError(
          fmt::format("line {} has {} bytes, more than {}: the file is binary or damaged; export it again", line_number_, line.size(), kLineMax));
    }
    if (comment_ != '\0') line = line.substr(0, line.find(comment_));
    if (line.find_first_not_of(kBlanks) != std::string_view::npos) return true;
  }
  return false;
}

std::string_view TakeWord(std::string_view& line) {
  const std::size_t begin = line.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) {
    line = {};
    return {};
  }
  const std::size_t end = std::min(line.find_first_of(kBlanks, begin), line.size());
  const std::string_view word = line.substr(begin, end - begin);
  line.remove_prefix(end);
  return word;
}

bool ParseNumber(std::string_view word, double& value) { return ParseWhole(word, value); }
bool ParseInteger(std::string_view word, std::int64_t& value) { return ParseWhole(word, value); }

}  // namespace vorocast::capture
