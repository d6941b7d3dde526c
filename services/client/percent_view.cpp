// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/percent_view.h"

#include <unistd.h>

#include <cstdio>

#include <fmt/format.h>

#include "services/client/job_view.h"

namespace vorocast::client {

PercentView::PercentView(std::string title)
    : title_(std::move(title)), terminal_(isatty(STDOUT_FILENO) == 1), start_(std::chrono::steady_clock::now()), last_(start_) {}

void PercentView::Show(double fraction) {
  const auto now = std::chrono::steady_clock::now();
  const auto interval = terminal_ ? std::chrono::milliseconds(200) : std::chrono::milliseconds(5000);
  if (now - start_ < std::chrono::seconds(2) || now - last_ < interval) return;
  last_ = now;
  const double elapsed = std::chrono::duration<double>(now - start_).count();
  const double left = fraction > 0 ? elapsed * (1 - fraction) / fraction : -1;
  fmt::print("{}{}  {:.0f} %, about {} left{}", terminal_ ? "\r" : "", title_, 100 * fraction, FormatDuration(left), terminal_ ? "   " : "\n");
  std::fflush(stdout);
  shown_ = true;
}

void PercentView::Finish() {
  if (terminal_ && shown_) fmt::print("\r{}  done                         \n", title_);
}

}  // namespace vorocast::client
