// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/report/timeline.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "absl/time/time.h"
#include "services/report/html.h"
#include "services/tasks/task.h"

namespace vorocast::report {
namespace {

constexpr std::size_t kKinds = std::size(tasks::kAllKinds);
/// Told apart by most eyes (after Paul Tol's qualitative schemes); in the order of kAllKinds.
constexpr std::array<std::string_view, kKinds> kColours = {"#4477aa", "#ee6677", "#ccbb44", "#aa3377", "#228833",
                                                           "#66ccee", "#ee8866", "#bbbbbb", "#332288", "#44bb99"};
constexpr std::string_view kOther = "#888888";
constexpr std::size_t kRowsMax = 200;
/// Of all rows together: what keeps a drawing small.
constexpr std::size_t kColumnsInAll = 60'000;
constexpr std::size_t kColumnsMax = 800;
constexpr int kRowHeight = 14;
constexpr int kBarHeight = 11;
constexpr int kNameWidth = 190;
constexpr int kAxisHeight = 22;

std::uint8_t KindIndex(std::string_view name) {
  const auto kind = tasks::KindFromName(name);
  return kind.ok() ? static_cast<std::uint8_t>(*kind) : static_cast<std::uint8_t>(kKinds);
}

/// One worker's time: seconds of each kind in each column.
struct Row {
  std::uint32_t worker = 0;
  double busy = 0;
  std::vector<std::array<float, kKinds + 1>> columns;
  std::vector<bool> failed;
};

/// Runs of columns of one kind as one path a kind.
std::string Bars(const Row& row, int top) {
  std::array<std::string, kKinds + 1> paths;
  const auto kind_of = [&](std::size_t column) {
    const auto& seconds = row.columns[column];
    const auto most = std::max_element(seconds.begin(), seconds.end());
    return *most > 0 ? static_cast<int>(most - seconds.begin()) : -1;
  };
  for (std::size_t first = 0; first < row.columns.size();) {
    const int kind = kind_of(first);
    std::size_t last = first + 1;
    while (last < row.columns.size() && kind_of(last) == kind) ++last;
    const std::size_t width = last - first;
    if (kind >= 0)
      paths[static_cast<std::size_t>(kind)] += fmt::format("M{} {}h{}v{}h-{}z", kNameWidth + static_cast<int>(first), top, width, kBarHeight, width);
    first = last;
  }
  std::string svg;
  for (std::size_t kind = 0; kind < paths.size(); ++kind) {
    if (!paths[kind].empty()) svg += fmt::format("<path fill=\"{}\" d=\"{}\"/>", kind < kKinds ? kColours[kind] : kOther, paths[kind]);
  }
  std::string marks;
  for (std::size_t column = 0; column < row.failed.size(); ++column) {
    if (row.failed[column]) marks += fmt::format("M{} {}v{}", kNameWidth + static_cast<int>(column), top - 1, kBarHeight + 2);
  }
  if (!marks.empty()) svg += fmt::format("<path stroke=\"#d00000\" stroke-width=\"2\" d=\"{}\"/>", marks);
  return svg;
}

std::string Axis(double begin, double end, std::size_t columns, int top) {
  constexpr int kTicks = 5;
  std::string svg;
  for (int tick = 0; tick <= kTicks; ++tick) {
    const double x = kNameWidth + static_cast<double>(columns) * tick / kTicks;
    const absl::Time time = absl::UnixEpoch() + absl::Seconds(begin + (end - begin) * tick / kTicks);
    const char* const anchor = tick == 0 ? "start" : tick == kTicks ? "end" : "middle";
    svg += fmt::format("<path stroke=\"#ccc\" d=\"M{:.0f} 0v{}\"/><text x=\"{:.0f}\" y=\"{}\" text-anchor=\"{}\">{}</text>", x, top + 4, x, top + 16,
                       anchor, absl::FormatTime("%H:%M:%S", time, absl::LocalTimeZone()));
  }
  return svg;
}

/// At most `count` characters, the middle left out; workers' names differ at both ends.
std::string Shorten(const std::string& name, std::size_t count) {
  if (name.size() <= count) return name;
  return name.substr(0, count / 2 - 1) + "…" + name.substr(name.size() - count / 2);
}

}  // namespace

std::string_view KindColour(std::string_view kind) {
  const std::size_t index = KindIndex(kind);
  return index < kKinds ? kColours[index] : kOther;
}

void Timeline::Add(const v1::TaskAttempt& attempt, double now) {
  const double end = attempt.ended() > 0 ? attempt.ended() : now;
  if (!(attempt.started() > 0) || !(end >= attempt.started())) return;
  begin_ = attempts_.empty() ? attempt.started() : std::min(begin_, attempt.started());
  end_ = attempts_.empty() ? end : std::max(end_, end);
  const auto worker = workers_.emplace(attempt.worker(), static_cast<std::uint32_t>(workers_.size())).first;
  attempts_.push_back({worker->second, KindIndex(attempt.kind()), attempt.outcome() == v1::FAILED, attempt.started(), end});
}

std::string Timeline::Svg() const {
  if (attempts_.empty()) return {};
  std::vector<Row> rows(workers_.size());
  for (std::uint32_t worker = 0; worker < rows.size(); ++worker) rows[worker].worker = worker;
  for (const Attempt& attempt : attempts_) rows[attempt.worker].busy += attempt.end - attempt.begin;
  // The busiest ones, then all of those by name.
  std::vector<std::uint32_t> shown(rows.size());
  for (std::uint32_t worker = 0; worker < shown.size(); ++worker) shown[worker] = worker;
  std::stable_sort(shown.begin(), shown.end(), [&](std::uint32_t a, std::uint32_t b) { return rows[a].busy > rows[b].busy; });
  if (shown.size() > kRowsMax) shown.resize(kRowsMax);
  std::vector<bool> is_shown(rows.size(), false);
  for (const std::uint32_t worker : shown) is_shown[worker] = true;

  const std::size_t columns = std::clamp(kColumnsInAll / shown.size(), std::size_t{100}, kColumnsMax);
  for (const std::uint32_t worker : shown) {
    rows[worker].columns.resize(columns);
    rows[worker].failed.resize(columns);
  }
  const double column_seconds = std::max(1e-3, end_ - begin_) / static_cast<double>(columns);
  const auto column_of = [&](double time) {
    return std::min(columns - 1, static_cast<std::size_t>(std::max(0.0, (time - begin_) / column_seconds)));
  };
  for (const Attempt& attempt : attempts_) {
    if (!is_shown[attempt.worker]) continue;
    Row& row = rows[attempt.worker];
    const std::size_t last = column_of(attempt.end);
    for (std::size_t column = column_of(attempt.begin); column <= last; ++column) {
      const double from = std::max(attempt.begin, begin_ + static_cast<double>(column) * column_seconds);
      const double to = std::min(attempt.end, begin_ + static_cast<double>(column + 1) * column_seconds);
      row.columns[column][attempt.kind] += static_cast<float>(std::max(1e-6, to - from));
    }
    if (attempt.failed) row.failed[last] = true;
  }

  const int height = static_cast<int>(shown.size()) * kRowHeight + kAxisHeight;
  const int width = kNameWidth + static_cast<int>(columns) + 8;
  std::string svg = fmt::format(
      "<svg class=\"timeline\" viewBox=\"0 0 {} {}\" width=\"{}\" height=\"{}\" role=\"img\" aria-label=\"What each worker did, over time\">", width,
      height, width, height);
  svg += Axis(begin_, end_, columns, height - kAxisHeight);
  int top = 1;
  for (const auto& [name, worker] : workers_) {
    if (!is_shown[worker]) continue;
    svg += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}<title>{}</title></text>", kNameWidth - 6, top + 10, Escape(Shorten(name, 26)),
                       Escape(name));
    svg += Bars(rows[worker], top) + "\n";
    top += kRowHeight;
  }
  svg += "</svg>";
  if (shown.size() < rows.size()) svg += fmt::format("<p>The busiest {} of {} workers.</p>", shown.size(), rows.size());
  return svg;
}

}  // namespace vorocast::report
