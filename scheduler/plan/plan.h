// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "services/base/digest.h"
#include "services/base/status.h"
#include "services/tasks/options.h"
#include "services/tasks/task.h"

/// Pure: turns a take into tasks. No clock, no store, no messages.
namespace vorocast::plan {

struct PlannedFrame {
  std::int32_t number = 0;
  base::Digest blob;
  std::string extension;
};

/// A second take, which an effect turns the job's own into (paper, section 6.3). It is cast and tracked with the job's options, but for what its own
/// sequence says, and its template is chosen from its own frames.
struct OntoTake {
  std::string sequence;  // its id, by which the job finds its frames again
  tasks::CaptureFrameOptions capture;
  double frames_per_second = 25;
};

/// What a user asked for, checked and with defaults filled in.
struct JobSpec {
  tasks::TessellateOptions tessellate;
  std::int32_t template_frame = -1;  // −1: chosen by the template task from the tessellated frames
  std::int32_t patches = 200;
  std::int32_t window_frames = 10;
  std::int32_t overlap_frames = 1;    // frames that a window shares with the next
  std::int32_t stretch_frames = 48;   // about; a take is followed coarsely in stretches of so many frames, side by side
  std::int32_t interpolated_max = 0;  // bad frames that are made up for; negative: a tenth of the take's frames
  double frames_per_second = 25;
  tasks::TrackOptions track;
  nlohmann::json effect;  // null: tracking only
  bool sheets = true;
  std::optional<tasks::FilmOptions> film;
  std::optional<OntoTake> onto;  // never without an effect
};

/// What is known of a take's frames. `closed`: no frame will follow.
struct KnownTake {
  std::vector<PlannedFrame> frames;
  bool closed = false;
};

/// An input by name of the planned task that makes it; its digest is known when that task has ended.
struct PlannedInput {
  std::string role;
  std::int32_t frame = -1;
  std::string task;   // a PlannedTask's name; empty for a blob
  base::Digest blob;  // with an empty task
  std::string extension;
  bool optional = false;  // may be missing: the frame is then interpolated
};

struct PlannedTask {
  std::string name;  // unique within the job, for people: "frame 412: tessellate", "window 40-49: track", "pendulum: simulate"
  tasks::Kind kind = tasks::Kind::kTessellate;
  nlohmann::json options;
  std::vector<PlannedInput> inputs;
  std::string output;  // name for users, or empty: "cells/frame_000412.h5", "tracked.h5"
};

/// The tasks that can be named from the frames known so far. `closed`: no frame will follow, so everything can be named.
/// Calling it again with more frames returns a superset: the same names with the same content. So the tasks of frames that have just arrived can be
/// had by naming only those. The order is that in which a worker should take them; when a take is closed, what others wait for comes first.
/// `onto`: of the job's second take, if it has one. Names of that take's tasks begin with "onto: ", names of its results with "onto/"; what needs
/// both takes can be named once both are closed.
/// FAILED_PRECONDITION for a closed take without frames or without the template frame that the job names.
absl::StatusOr<std::vector<PlannedTask>> Plan(const JobSpec& job, const std::vector<PlannedFrame>& frames, bool closed, const KnownTake& onto = {});

/// How many bad frames the job puts up with in a take of that many frames.
std::int32_t InterpolatedMax(const JobSpec& job, std::int32_t frame_count);

/// Every field, for the database; the options of FromJson's job are checked (INVALID_ARGUMENT names the field).
nlohmann::json ToJson(const JobSpec& job);
absl::StatusOr<JobSpec> JobSpecFromJson(const nlohmann::json& json);

/// Positions [first, last) in the take of one tracking window or stretch.
struct WindowRange {
  std::int32_t first = 0;
  std::int32_t last = 0;
};
/// Consecutive windows share `overlap_frames`; a last window with less than half of the usual new frames is merged into the one before.
std::vector<WindowRange> SplitWindows(std::int32_t frame_count, std::int32_t window_frames, std::int32_t overlap_frames);
/// Stretches of equal length but for one frame, nearest to `stretch_frames`, each grown by a few frames that it shares with its neighbours. A take
/// of less than one and a half stretches is one.
std::vector<WindowRange> SplitStretches(std::int32_t frame_count, std::int32_t stretch_frames);

}  // namespace vorocast::plan
