// SPDX-License-Identifier: AGPL-3.0-or-later
#include <algorithm>

#include "scheduler/plan/plan.h"
#include "services/base/check.h"

namespace vorocast::plan {
namespace {

/// Neighbouring stretches share five frames, so that a bad one between them does no harm.
constexpr std::int32_t kSharedBefore = 2;
constexpr std::int32_t kSharedAfter = 3;

}  // namespace

std::vector<WindowRange> SplitWindows(std::int32_t frame_count, std::int32_t window_frames, std::int32_t overlap_frames) {
  VOROCAST_CHECK(window_frames > 0 && overlap_frames >= 0 && overlap_frames < window_frames);
  std::vector<WindowRange> windows;
  const std::int32_t stride = window_frames - overlap_frames;
  for (std::int32_t first = 0; first < frame_count; first += stride) {
    const std::int32_t last = std::min(frame_count, first + window_frames);
    windows.push_back({first, last});
    if (last == frame_count) break;
  }
  // A short last window would be held by few frames only: its new frames go to the one before.
  if (windows.size() > 1 && windows.back().last - windows.back().first < overlap_frames + (stride + 1) / 2) {
    windows.pop_back();
    windows.back().last = frame_count;
  }
  return windows;
}

std::vector<WindowRange> SplitStretches(std::int32_t frame_count, std::int32_t stretch_frames) {
  VOROCAST_CHECK(stretch_frames > 0);
  const std::int32_t count = std::max(1, (frame_count + stretch_frames / 2) / stretch_frames);
  std::vector<WindowRange> stretches;
  for (std::int64_t s = 0; s < count; ++s) {
    const auto first = static_cast<std::int32_t>(s * frame_count / count);
    const auto last = static_cast<std::int32_t>((s + 1) * frame_count / count);
    stretches.push_back({std::max(0, first - kSharedBefore), std::min(frame_count, last + kSharedAfter)});
  }
  return stretches;
}

}  // namespace vorocast::plan
