// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <chrono>
#include <string>

namespace vorocast::client {

/// Progress of one step that the client does itself: "Frames  42 %, about 0:12 left". Silent for what takes less than two seconds.
class PercentView {
 public:
  explicit PercentView(std::string title);
  void Show(double fraction);
  void Finish();

 private:
  std::string title_;
  bool terminal_;
  bool shown_ = false;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_;
};

}  // namespace vorocast::client
