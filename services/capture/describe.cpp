// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <tuple>

#include "services/capture/inspect.h"
#include "services/capture/units.h"

namespace vorocast::capture {
namespace {

/// Heights of a standing or crouching person; outside of it the unit is doubtful.
constexpr double kPersonMinMetres = 0.8;
constexpr double kPersonMaxMetres = 3;

/// 73091 -> "73,091".
std::string Grouped(std::int64_t value) {
  return value < 1000 ? fmt::format("{}", value) : fmt::format("{},{:03}", Grouped(value / 1000), value % 1000);
}

/// "1 frame", "21 frames".
std::string Frames(std::size_t count) { return fmt::format("{} frame{}", count, count == 1 ? "" : "s"); }

/// The least and the greatest of what has been added.
struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void Add(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  std::string Counts() const {
    const auto a = static_cast<std::int64_t>(low);
    const auto b = static_cast<std::int64_t>(high);
    return a == b ? Grouped(a) : fmt::format("{}-{}", Grouped(a), Grouped(b));
  }
  std::string Metres() const {
    const std::string a = fmt::format("{:.2f}", low);
    const std::string b = fmt::format("{:.2f}", high);
    return a == b ? a + " m" : fmt::format("{}-{} m", a, b);
  }
};

double Height(const FrameFacts& facts) { return facts.box.sizes().y(); }

std::string NormalsOf(NormalSource source) {
  switch (source) {
    case NormalSource::kFile:
      return "normals";
    case NormalSource::kMesh:
      return "normals from the mesh";
    case NormalSource::kEstimated:
      return "no normals (they are estimated)";
  }
  return "";
}

/// An error without the path that it starts with: equal causes of different files fold into one line.
std::string Cause(const FrameFacts& facts, const Capture& capture, std::size_t index) {
  std::string cause(facts.status.message());
  const std::string path = capture.frames[index].path.string() + ": ";
  if (cause.starts_with(path)) cause.erase(0, path.size());
  return cause;
}

/// What must be equal for two frames to share a line: their counts and sizes may differ, and the numbers in their errors.
std::string Kind(const Inspection& inspection, std::size_t index) {
  const FrameFacts& facts = inspection.frames[index];
  if (facts.status.ok()) {
    const char* mesh = facts.closed ? ", closed mesh" : ", mesh not closed";
    return NormalsOf(facts.normals) + (facts.colours ? ", colours" : "") + (facts.triangles > 0 ? mesh : "");
  }
  std::string kind = Cause(facts, inspection.capture, index);
  std::erase_if(kind, [](char c) { return (c >= '0' && c <= '9') || c == '.'; });
  return "!" + kind;
}

/// Frames of one kind, in order.
struct Group {
  std::string kind;
  std::vector<std::size_t> members;
};

/// In the order of their first frames.
std::vector<Group> GroupFrames(const Inspection& inspection) {
  std::vector<Group> groups;
  for (std::size_t i = 0; i < inspection.frames.size(); ++i) {
    const std::string kind = Kind(inspection, i);
    auto found = std::ranges::find(groups, kind, &Group::kind);
    if (found == groups.end()) found = groups.insert(groups.end(), Group{kind, {}});
    found->members.push_back(i);
  }
  return groups;
}

/// "frames 0-20" or "frames 3, 7-9, 12, … (40 frames)".
std::string FrameNumbers(const Inspection& inspection, const std::vector<std::size_t>& members) {
  constexpr int kRunsMax = 6;
  std::string text;
  int runs = 0;
  for (std::size_t i = 0; i < members.size();) {
    const std::int32_t first = inspection.frames[members[i]].number;
    std::int32_t last = first;
    for (++i; i < members.size() && inspection.frames[members[i]].number == last + 1; ++i) ++last;
    if (++runs <= kRunsMax)
      text += fmt::format("{}{}", runs > 1 ? ", " : "", first == last ? fmt::format("{}", first) : fmt::format("{}-{}", first, last));
  }
  if (members.size() == 1) return "frame " + text;
  if (runs == 1) return "frames " + text;
  return fmt::format("frames {}{} ({})", text, runs > kRunsMax ? ", …" : "", Frames(members.size()));
}

std::string DescribeGroup(const Inspection& inspection, const Group& group) {
  const std::string numbers = FrameNumbers(inspection, group.members);
  const FrameFacts& first = inspection.frames[group.members[0]];
  if (!first.status.ok()) return fmt::format("  {}: cannot be used: {}\n", numbers, Cause(first, inspection.capture, group.members[0]));
  Range points;
  Range triangles;
  Range parts;
  Range heights;
  for (std::size_t i : group.members) {
    const FrameFacts& facts = inspection.frames[i];
    points.Add(static_cast<double>(facts.points));
    triangles.Add(static_cast<double>(facts.triangles));
    parts.Add(facts.components);
    heights.Add(Height(facts));
  }
  const std::string mesh = triangles.high > 0 ? triangles.Counts() + " triangles, " : "";
  const std::string of_parts = parts.high > 1 ? fmt::format(" of {} parts", parts.Counts()) : "";
  return fmt::format("  {}: {} points, {}{}{}, {} tall\n", numbers, points.Counts(), mesh, group.kind, of_parts, heights.Metres());
}

std::string UnitOf(double metres_per_unit) {
  for (const char* unit : {"m", "cm", "mm", "in", "ft"}) {
    if (const auto metres = MetresPerUnit(unit); metres.ok() && *metres == metres_per_unit) return unit;
  }
  return fmt::format("{} m", metres_per_unit);
}

/// What a person should look at before a night of computing is spent on it.
std::string DescribeHints(const Inspection& inspection) {
  std::string text;
  std::size_t bad = 0;
  std::size_t estimated = 0;
  std::int64_t dropped = 0;
  std::vector<double> heights;
  std::map<std::int32_t, std::size_t> unexpected;  // parts -> frames
  for (const FrameFacts& facts : inspection.frames) {
    if (!facts.status.ok()) {
      ++bad;
      continue;
    }
    heights.push_back(Height(facts));
    estimated += facts.normals == NormalSource::kEstimated ? 1 : 0;
    dropped += facts.notes.dropped_points;
    const bool counted = facts.triangles > 0 && inspection.capture.components > 0;
    if (counted && facts.components != inspection.capture.components) ++unexpected[facts.components];
  }
  if (bad == inspection.frames.size()) return "  no frame can be used\n";
  if (bad > 0) text += fmt::format("  {} of {} frames cannot be used; their poses would be interpolated\n", bad, inspection.frames.size());
  if (!heights.empty()) {
    std::ranges::nth_element(heights, heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 2));
    const double median = heights[heights.size() / 2];
    const std::string unit = UnitOfPerson(median / inspection.capture.metres_per_unit);
    if (median < kPersonMinMetres || median > kPersonMaxMetres) {
      text += fmt::format("  a person would be {:.2f} m tall here: {}\n", median,
                          unit.empty() ? "check --units and --up" : fmt::format("did you mean --units {}?", unit));
    }
  }
  if (estimated > 0) text += fmt::format("  {} without normals; estimating them takes about a second a frame\n", Frames(estimated));
  if (dropped > 0) text += fmt::format("  {} points are left out: not finite, or with a zero normal\n", Grouped(dropped));
  for (const auto& [parts, frames] : unexpected) {
    text += fmt::format("  {} of {} parts where {} are expected\n", Frames(frames), parts, inspection.capture.components);
  }
  return text;
}

}  // namespace

std::string Describe(const Inspection& inspection) {
  const Capture& capture = inspection.capture;
  Range heights;
  for (const FrameFacts& facts : inspection.frames) {
    if (facts.status.ok()) heights.Add(Height(facts));
  }
  const auto count = static_cast<double>(inspection.frames.size());
  std::string text = fmt::format("{}: {}, {:g} frames/s ({:.1f} s), unit {}, {} up", capture.name, Frames(inspection.frames.size()),
                                 capture.frames_per_second, count / capture.frames_per_second, UnitOf(capture.metres_per_unit), capture.up);
  if (heights.high >= 0) text += fmt::format(", {} tall", heights.Metres());
  text += "\n";
  for (const Group& group : GroupFrames(inspection)) text += DescribeGroup(inspection, group);
  return text + DescribeHints(inspection);
}

}  // namespace vorocast::capture
