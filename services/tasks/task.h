// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "services/base/digest.h"

/// What the scheduler and those who take its leases agree on: kinds of task, how a result is named.
namespace vorocast::tasks {

enum class Kind : std::uint8_t {
  kTessellate,  // one frame's points -> cells.h5
  kTemplate,    // one frame's points -> template.h5 (more iterations, patches)
  kStretch,     // the cells of a stretch's frames -> stretch.h5: how they move coarsely, whatever the template
  kGuide,       // template + every frame's cells -> guide.h5: a coarse pose of every patch in every frame. In a long take: template + all stretches
                // + the cells of the frames that those share -> guide.h5: coarse poses in the seams between stretches
  kTrack,       // template + guide (+ the window's stretches) + the cells of one window's frames -> window.h5
  kAssemble,    // template + all windows -> tracked.h5
  kSimulate,    // tracked.h5 + effect -> simulated.h5
  kSheet,       // pictures of one stage -> PNG
  kRender,      // tracked.h5, simulated.h5 + an instant -> EXR
  kEncode,      // all rendered pictures -> MP4
};
inline constexpr Kind kAllKinds[] = {Kind::kTessellate, Kind::kTemplate, Kind::kStretch, Kind::kGuide,  Kind::kTrack,
                                     Kind::kAssemble,   Kind::kSimulate, Kind::kSheet,   Kind::kRender, Kind::kEncode};

std::string_view Name(Kind kind);                          // "tessellate", …
absl::StatusOr<Kind> KindFromName(std::string_view name);  // INVALID_ARGUMENT lists the names
/// Raised whenever a change of code changes a result's bytes; part of every key.
int KernelVersion(Kind kind);
/// The file-name extension of the kind's result, with its dot: ".h5", ".png", ".exr" or ".mp4".
std::string_view Extension(Kind kind);

/// One thing a task reads. A captured frame is a blob named by its bytes; a result is an artifact named by what made it.
struct Input {
  enum class Source : std::uint8_t { kBlob, kArtifact };
  std::string role;         // "frame", "template", "stretch", "guide", "cells", "window", "tracked", "simulated", "picture"
  std::int32_t frame = -1;  // captured frame number it stands for, or −1
  Source source = Source::kArtifact;
  std::string extension;  // of the stored file, with its dot: ".ply", ".h5"
  /// Empty for an optional input whose own task failed for good: its frame is interpolated.
  std::optional<base::Digest> digest;
  /// SHA-256 of an artifact's bytes as they were when it was made, where that is known: who reads it can tell damage. No part of a result's name.
  std::optional<base::Digest> content;
};

/// A task with everything its result depends on.
struct TaskSpec {
  Kind kind = Kind::kTessellate;
  nlohmann::json options;     // an object; the kind's options struct in options.h reads and writes it
  std::vector<Input> inputs;  // in the kind's order

  /// Digest of (kind, kernel version, options as canonical JSON, inputs): the name of the result.
  base::Digest Key() const;
};

nlohmann::json ToJson(const TaskSpec& spec);
/// Checks everything: what comes over a wire is not believed. INVALID_ARGUMENT names the field.
absl::StatusOr<TaskSpec> TaskSpecFromJson(const nlohmann::json& json);

}  // namespace vorocast::tasks
