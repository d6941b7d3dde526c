// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "services/base/progress.h"
#include "services/base/status.h"
#include "services/capture/capture.h"
#include "services/capture/frame_reader.h"
#include "services/geometry/vector.h"

namespace vorocast::capture {

enum class NormalSource {
  kFile,
  kMesh,       // computed from the triangles
  kEstimated,  // will be estimated when the frame is processed; inspection does not take the time
};

/// What one frame holds, or why it cannot be used.
struct FrameFacts {
  std::int32_t number = 0;
  absl::Status status;  // not OK: the rest is unset
  std::int64_t points = 0;
  std::int64_t triangles = 0;
  NormalSource normals = NormalSource::kFile;
  bool colours = false;
  bool closed = false;          // a mesh whose every edge joins two triangles of one orientation
  std::int32_t components = 0;  // connected parts of a mesh; 0 for a point cloud
  geometry::Box3 box;           // metres, y up
  ReadNotes notes;
};

struct Inspection {
  Capture capture;
  std::vector<FrameFacts> frames;  // as many as the capture's, in its order
};

/// Reads every frame, one after another. A frame that cannot be used is a fact like any other: only a capture without frames is an error.
absl::StatusOr<Inspection> InspectCapture(const Capture& capture, const base::Progress& progress = {});

/// For people: a summary, then a line for all frames that are alike, then what looks wrong and what to do about it.
std::string Describe(const Inspection& inspection);

}  // namespace vorocast::capture
