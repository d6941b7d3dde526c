// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/plan/plan.h"

#include <algorithm>
#include <set>

#include <fmt/format.h>

#include "scheduler/plan/film.h"

namespace vorocast::plan {
namespace {

constexpr std::int32_t kTemplateIterations = 50;
constexpr std::int32_t kSheetPictures = 12;
/// So many frames are looked at for the template: neighbouring ones are alike, and a task that reads them all would hold up a long take.
constexpr std::size_t kTemplateCandidates = 64;
/// A stretch brings the template so near to what was seen in a seam that half of the usual iterations are as good.
constexpr std::int32_t kSeamIterations = 5;
constexpr std::string_view kTemplate = "template";
constexpr std::string_view kGuide = "guide";
constexpr std::string_view kAssemble = "assemble";

std::string TessellateName(std::int32_t frame) { return fmt::format("frame {}: tessellate", frame); }

std::string OfOnto(const std::string& task) { return "onto: " + task; }

std::string SimulateName(const nlohmann::json& effect) {
  const auto name = effect.find("name");
  return fmt::format("{}: simulate", name != effect.end() && name->is_string() ? name->get<std::string>() : "effect");
}

PlannedInput Blob(const PlannedFrame& frame) { return {.role = "frame", .frame = frame.number, .blob = frame.blob, .extension = frame.extension}; }

PlannedInput Result(std::string role, std::string task) {
  return {.role = std::move(role), .task = std::move(task), .extension = std::string(tasks::Extension(tasks::Kind::kTessellate))};
}

/// A frame that could not be tessellated is interpolated by those who read the others.
PlannedInput CellsOf(const PlannedFrame& frame) {
  PlannedInput input = Result("cells", TessellateName(frame.number));
  input.frame = frame.number;
  input.optional = true;
  return input;
}

PlannedTask Tessellate(const JobSpec& job, const PlannedFrame& frame) {
  return {.name = TessellateName(frame.number),
          .kind = tasks::Kind::kTessellate,
          .options = tasks::ToJson(job.tessellate),
          .inputs = {Blob(frame)},
          .output = fmt::format("cells/frame_{:06}.h5", frame.number)};
}

/// At most so many frames, the first and the last among them, evenly between.
std::vector<PlannedFrame> Spread(const std::vector<PlannedFrame>& frames, std::size_t most) {
  if (frames.size() <= most) return frames;
  std::vector<PlannedFrame> chosen;
  for (std::size_t i = 0; i < most; ++i) chosen.push_back(frames[i * (frames.size() - 1) / (most - 1)]);
  return chosen;
}

PlannedTask Template(const JobSpec& job, const std::vector<PlannedFrame>& frames) {
  tasks::TemplateOptions options{.tessellate = job.tessellate, .frame = job.template_frame, .patches = job.patches};
  options.tessellate.iterations = kTemplateIterations;
  PlannedTask task{.name = std::string(kTemplate), .kind = tasks::Kind::kTemplate, .options = tasks::ToJson(options), .output = "template.h5"};
  if (job.template_frame >= 0) {
    for (const PlannedFrame& frame : frames) {
      if (frame.number == job.template_frame) task.inputs.push_back(Blob(frame));
    }
  } else {
    const std::vector<PlannedFrame> candidates = Spread(frames, kTemplateCandidates);
    for (const PlannedFrame& frame : candidates) task.inputs.push_back(Blob(frame));
    for (const PlannedFrame& frame : candidates) task.inputs.push_back(CellsOf(frame));
  }
  return task;
}

PlannedTask Stretch(const JobSpec& job, const std::vector<PlannedFrame>& frames, WindowRange range) {
  PlannedTask task{.kind = tasks::Kind::kStretch};
  task.name = fmt::format("stretch {}-{}: follow", frames[range.first].number, frames[range.last - 1].number);
  for (std::int32_t i = range.first; i < range.last; ++i) task.inputs.push_back(CellsOf(frames[i]));
  task.options = tasks::ToJson(tasks::StretchOptions{.patches = job.patches});
  return task;
}

/// A take in parts: how its stretches move, and where in the take each lies. A short take has none.
struct PlannedStretches {
  std::vector<WindowRange> ranges;
  std::vector<PlannedTask> tasks;
};

PlannedStretches Stretches(const JobSpec& job, const std::vector<PlannedFrame>& frames) {
  PlannedStretches stretches{.ranges = SplitStretches(static_cast<std::int32_t>(frames.size()), job.stretch_frames), .tasks = {}};
  if (stretches.ranges.size() == 1) return {};
  for (const WindowRange range : stretches.ranges) stretches.tasks.push_back(Stretch(job, frames, range));
  return stretches;
}

/// Coarse poses: of all frames, or where the take's stretches meet.
PlannedTask Guide(const std::vector<PlannedFrame>& frames, const PlannedStretches& stretches) {
  tasks::GuideOptions options;
  if (!stretches.tasks.empty()) options.iterations = kSeamIterations;
  PlannedTask task{.name = std::string(kGuide), .kind = tasks::Kind::kGuide, .options = tasks::ToJson(options)};
  task.inputs.push_back(Result("template", std::string(kTemplate)));
  for (const PlannedTask& stretch : stretches.tasks) task.inputs.push_back(Result("stretch", stretch.name));
  if (stretches.tasks.empty()) {
    for (const PlannedFrame& frame : frames) task.inputs.push_back(CellsOf(frame));
  }
  for (std::size_t s = 1; s < stretches.ranges.size(); ++s) {
    for (std::int32_t i = stretches.ranges[s].first; i < stretches.ranges[s - 1].last; ++i) task.inputs.push_back(CellsOf(frames[i]));
  }
  return task;
}

PlannedTask Track(const JobSpec& job, const std::vector<PlannedFrame>& frames, const PlannedStretches& stretches, WindowRange window) {
  tasks::TrackOptions options = job.track;
  options.frames.clear();
  PlannedTask task{.kind = tasks::Kind::kTrack};
  task.name = fmt::format("window {}-{}: track", frames[window.first].number, frames[window.last - 1].number);
  task.inputs.push_back(Result("template", std::string(kTemplate)));
  task.inputs.push_back(Result("guide", std::string(kGuide)));
  for (std::size_t s = 0; s < stretches.tasks.size(); ++s) {
    const bool overlap = stretches.ranges[s].first < window.last && window.first < stretches.ranges[s].last;
    if (overlap) task.inputs.push_back(Result("stretch", stretches.tasks[s].name));
  }
  for (std::int32_t i = window.first; i < window.last; ++i) {
    options.frames.push_back(frames[i].number);
    task.inputs.push_back(CellsOf(frames[i]));
  }
  task.options = tasks::ToJson(options);
  return task;
}

PlannedTask Assemble(const JobSpec& job, const std::vector<PlannedFrame>& frames, const std::vector<PlannedTask>& windows) {
  tasks::AssembleOptions options{.frames_per_second = job.frames_per_second,
                                 .interpolated_max = InterpolatedMax(job, static_cast<std::int32_t>(frames.size()))};
  for (const PlannedFrame& frame : frames) options.frames.push_back(frame.number);
  PlannedTask task{.name = std::string(kAssemble), .kind = tasks::Kind::kAssemble, .options = tasks::ToJson(options), .output = "tracked.h5"};
  task.inputs.push_back(Result("template", std::string(kTemplate)));
  for (const PlannedTask& window : windows) task.inputs.push_back(Result("window", window.name));
  return task;
}

PlannedTask Simulate(const JobSpec& job) {
  PlannedTask task{.name = SimulateName(job.effect),
                   .kind = tasks::Kind::kSimulate,
                   .options = tasks::ToJson(tasks::SimulateOptions{.effect = job.effect}),
                   .inputs = {Result("tracked", std::string(kAssemble))},
                   .output = "simulated.h5"};
  if (job.onto) task.inputs.push_back(Result("target", OfOnto(std::string(kAssemble))));
  return task;
}

PlannedTask Sheet(const JobSpec& job, const std::string& stage, std::vector<PlannedInput> inputs) {
  const tasks::SheetOptions options{.stage = stage, .pictures = kSheetPictures, .capture = job.tessellate.capture};
  return {.name = fmt::format("{}: sheet", stage),
          .kind = tasks::Kind::kSheet,
          .options = tasks::ToJson(options),
          .inputs = std::move(inputs),
          .output = fmt::format("sheets/{}.png", stage)};
}

/// Of what is computed before any effect.
std::vector<PlannedTask> Sheets(const JobSpec& job, const std::vector<PlannedFrame>& frames) {
  std::vector<PlannedInput> points;
  std::vector<PlannedInput> cells;
  for (const PlannedFrame& frame : Spread(frames, kSheetPictures)) {
    points.push_back(Blob(frame));
    cells.push_back(CellsOf(frame));
  }
  cells.push_back(Result("template", std::string(kTemplate)));
  std::vector<PlannedTask> sheets;
  sheets.push_back(Sheet(job, "points", std::move(points)));
  sheets.push_back(Sheet(job, "cells", std::move(cells)));
  sheets.push_back(Sheet(job, "tracked", {Result("tracked", std::string(kAssemble))}));
  return sheets;
}

absl::StatusOr<std::vector<PlannedFrame>> Ordered(std::vector<PlannedFrame> frames) {
  std::sort(frames.begin(), frames.end(), [](const PlannedFrame& a, const PlannedFrame& b) { return a.number < b.number; });
  for (std::size_t i = 1; i < frames.size(); ++i) {
    if (frames[i - 1].number == frames[i].number) return absl::InvalidArgumentError(fmt::format("frame {} is in the take twice", frames[i].number));
  }
  return frames;
}

/// Cells of all frames, the template where it is still to be chosen from them, and each stretch as soon as its frames are there. In a long take what
/// the template is chosen from comes first: nothing after the stretches can start without it.
void AddCells(const JobSpec& job, const std::vector<PlannedFrame>& frames, const PlannedStretches& stretches, std::vector<PlannedTask>& planned) {
  std::set<std::int32_t> added;
  const auto add = [&](const PlannedFrame& frame) {
    if (added.insert(frame.number).second) planned.push_back(Tessellate(job, frame));
  };
  if (job.template_frame < 0) {
    for (const PlannedFrame& frame : Spread(frames, kTemplateCandidates)) add(frame);
    planned.push_back(Template(job, frames));
  }
  for (std::size_t s = 0; s < stretches.tasks.size(); ++s) {
    for (std::int32_t i = stretches.ranges[s].first; i < stretches.ranges[s].last; ++i) add(frames[i]);
    planned.push_back(stretches.tasks[s]);
  }
  for (const PlannedFrame& frame : frames) add(frame);
}

bool HasFrame(const std::vector<PlannedFrame>& frames, std::int32_t number) {
  return std::any_of(frames.begin(), frames.end(), [number](const PlannedFrame& frame) { return frame.number == number; });
}

void Append(std::vector<PlannedTask> more, std::vector<PlannedTask>& planned) { std::move(more.begin(), more.end(), std::back_inserter(planned)); }

/// From frames to tracked.h5.
absl::StatusOr<std::vector<PlannedTask>> PlanTracking(const JobSpec& job, const std::vector<PlannedFrame>& frames, bool closed) {
  if (closed && frames.empty()) return absl::FailedPreconditionError("the take was closed without a frame");
  const bool template_known = job.template_frame >= 0 && HasFrame(frames, job.template_frame);
  if (closed && job.template_frame >= 0 && !template_known) {
    return absl::FailedPreconditionError(fmt::format("frame {} was asked for as the template, but the take has no such frame", job.template_frame));
  }

  std::vector<PlannedTask> planned;
  if (template_known) planned.push_back(Template(job, frames));
  if (!closed) {
    for (const PlannedFrame& frame : frames) planned.push_back(Tessellate(job, frame));
    return planned;
  }

  const PlannedStretches stretches = Stretches(job, frames);
  AddCells(job, frames, stretches, planned);
  planned.push_back(Guide(frames, stretches));
  std::vector<PlannedTask> windows;
  for (const WindowRange& window : SplitWindows(static_cast<std::int32_t>(frames.size()), job.window_frames, job.overlap_frames)) {
    windows.push_back(Track(job, frames, stretches, window));
  }
  PlannedTask assemble = Assemble(job, frames, windows);
  Append(std::move(windows), planned);
  planned.push_back(std::move(assemble));
  return planned;
}

JobSpec SpecOfOnto(const JobSpec& job) {
  JobSpec spec = job;
  spec.tessellate.capture = job.onto->capture;
  spec.frames_per_second = job.onto->frames_per_second;
  spec.template_frame = -1;
  return spec;
}

/// The second take's tasks, so named that they are told from those of the first.
std::vector<PlannedTask> NamedOnto(std::vector<PlannedTask> tasks) {
  for (PlannedTask& task : tasks) {
    task.name = OfOnto(task.name);
    if (!task.output.empty()) task.output = "onto/" + task.output;
    for (PlannedInput& input : task.inputs) {
      if (!input.task.empty()) input.task = OfOnto(input.task);
    }
  }
  return tasks;
}

}  // namespace

std::int32_t InterpolatedMax(const JobSpec& job, std::int32_t frame_count) {
  return job.interpolated_max >= 0 ? job.interpolated_max : frame_count / 10;
}

absl::StatusOr<std::vector<PlannedTask>> Plan(const JobSpec& job, const std::vector<PlannedFrame>& unordered, bool closed, const KnownTake& onto) {
  ASSIGN_OR_RETURN(const std::vector<PlannedFrame> frames, Ordered(unordered));
  if (job.window_frames < 1 || job.overlap_frames < 0 || job.overlap_frames >= job.window_frames) {
    return absl::InvalidArgumentError(fmt::format("windows of {} frames cannot share {} with the next", job.window_frames, job.overlap_frames));
  }
  if (job.stretch_frames < 1) return absl::InvalidArgumentError(fmt::format("stretches of {} frames cannot be followed", job.stretch_frames));

  ASSIGN_OR_RETURN(std::vector<PlannedTask> planned, PlanTracking(job, frames, closed));
  std::vector<PlannedFrame> onto_frames;
  if (job.onto) {
    auto ordered = Ordered(onto.frames);
    if (!ordered.ok()) return base::Annotate(ordered.status(), "the second take");
    onto_frames = *std::move(ordered);
    auto tracking = PlanTracking(SpecOfOnto(job), onto_frames, onto.closed);
    if (!tracking.ok()) return base::Annotate(tracking.status(), "the second take");
    Append(NamedOnto(*std::move(tracking)), planned);
  }
  const bool whole = closed && (!job.onto || onto.closed);
  const bool simulated = whole && !job.effect.is_null();
  if (simulated) planned.push_back(Simulate(job));
  if (job.sheets && closed) Append(Sheets(job, frames), planned);
  if (job.sheets && job.onto && onto.closed) Append(NamedOnto(Sheets(SpecOfOnto(job), onto_frames)), planned);
  if (job.sheets && simulated) {
    planned.push_back(Sheet(job, "simulated", {Result("simulated", SimulateName(job.effect)), Result("tracked", std::string(kAssemble))}));
  }
  if (job.film && whole) {
    ASSIGN_OR_RETURN(std::vector<PlannedTask> film, Film(job, frames, std::string(kAssemble), simulated ? SimulateName(job.effect) : ""));
    Append(std::move(film), planned);
  }
  return planned;
}

}  // namespace vorocast::plan
