// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/agent/frame_cells.h"

#include <string>
#include <utility>

#include "services/capture/frame_reader.h"
#include "workers/agent/task_inputs.h"
#include "workers/cvt/indicator.h"
#include "workers/cvt/tessellate.h"

namespace vorocast::agent {
namespace {

/// A mesh of fewer vertices is sampled: tracking needs points every centimetre or so.
constexpr std::size_t kVerticesEnough = 20000;
constexpr std::size_t kPointsSampled = 40000;

// Shares of the time that the steps take, for the progress.
constexpr double kRead = 0.05;
constexpr double kShape = 0.4;

/// The stored file's name is a digest that tells people nothing; the frame is in the task's label.
absl::Status WithoutPath(const absl::Status& status, const std::filesystem::path& path) {
  const std::string message(status.message());
  const std::string prefix = path.string() + ": ";
  return message.starts_with(prefix) ? absl::Status(status.code(), message.substr(prefix.size())) : status;
}

absl::StatusOr<cvt::Shape> ShapeOf(const capture::Frame& frame, const tasks::TessellateOptions& options) {
  cvt::IndicatorOptions indicator;
  indicator.method = options.indicator == "cgal" ? cvt::IndicatorMethod::kCgal : cvt::IndicatorMethod::kSpectral;
  if (!frame.mesh.triangles.empty() && geometry::IsClosed(frame.mesh)) return cvt::ShapeFromMesh(frame.mesh, indicator, nullptr);
  return cvt::ShapeFromPoints(frame.points, indicator, nullptr);
}

geometry::OrientedPoints ObservedSurface(capture::Frame frame, std::uint64_t seed) {
  const bool coarse_mesh = !frame.mesh.triangles.empty() && frame.points.size() < kVerticesEnough;
  return coarse_mesh ? geometry::SampleSurface(frame.mesh, kPointsSampled, seed) : std::move(frame.points);
}

}  // namespace

absl::StatusOr<geometry::Cells> CellsOfFrame(const std::filesystem::path& path, const tasks::TessellateOptions& options,
                                             const base::Progress& progress) {
  absl::StatusOr<capture::Frame> frame = capture::ReadFrame(path, {options.capture.metres_per_unit, options.capture.up});
  if (!frame.ok()) return WithoutPath(frame.status(), path);
  base::Report(progress, kRead);
  ASSIGN_OR_RETURN(const cvt::Shape shape, ShapeOf(*frame, options));
  base::Report(progress, kShape);
  cvt::TessellateOptions cvt_options;
  cvt_options.cells = options.cells;
  cvt_options.iterations = options.iterations;
  cvt_options.start = options.start == "random" ? cvt::Start::kRandom : cvt::Start::kLattice;
  cvt_options.seed = options.seed;
  ASSIGN_OR_RETURN(geometry::Cells cells, cvt::Tessellate(shape, cvt_options, nullptr, Part(progress, kShape, 1)));
  cells.surface = ObservedSurface(*std::move(frame), options.seed);
  return cells;
}

}  // namespace vorocast::agent
