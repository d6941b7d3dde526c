// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/report/attempt_totals.h"

#include <algorithm>

namespace vorocast::report {
namespace {

constexpr std::size_t kFailuresKept = 200;
constexpr std::size_t kSlowKept = 10;
constexpr std::size_t kLogEndBytes = 1500;

bool Longer(const AttemptTotals::Slow& a, const AttemptTotals::Slow& b) { return a.seconds > b.seconds; }

std::string End(const std::string& log) {
  if (log.size() <= kLogEndBytes) return log;
  const std::size_t line = log.find('\n', log.size() - kLogEndBytes);
  return line == std::string::npos ? log.substr(log.size() - kLogEndBytes) : log.substr(line + 1);
}

}  // namespace

void AttemptTotals::Add(const v1::TaskAttempt& attempt) {
  if (attempt.outcome() == v1::RUNNING) return;
  const double seconds = std::max(0.0, attempt.ended() - attempt.started());
  ++attempts_;
  Kind& kind = kinds_[attempt.kind()];
  ++kind.attempts;
  kind.seconds += seconds;
  kind.cpu_seconds += attempt.cpu_seconds();
  kind.memory_peak = std::max<std::int64_t>(kind.memory_peak, attempt.memory_peak());
  if (attempt.outcome() == v1::FAILED) {
    ++failed_;
    ++kind.failed;
    if (failures_.size() < kFailuresKept) failures_.push_back({attempt.task(), attempt.worker(), attempt.cause(), seconds, End(attempt.log())});
  }
  if (attempt.outcome() != v1::DONE) return;
  slow_.push_back({attempt.task(), attempt.worker(), seconds});
  std::push_heap(slow_.begin(), slow_.end(), Longer);
  if (slow_.size() <= kSlowKept) return;
  std::pop_heap(slow_.begin(), slow_.end(), Longer);
  slow_.pop_back();
}

std::vector<AttemptTotals::Slow> AttemptTotals::Slowest() const {
  std::vector<Slow> slowest = slow_;
  std::sort(slowest.begin(), slowest.end(), Longer);
  return slowest;
}

}  // namespace vorocast::report
