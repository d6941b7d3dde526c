// SPDX-License-Identifier: AGPL-3.0-or-later
// What a film's picture costs: CPU seconds of one core for 1080p of 5000 cells, standing still and with the upper half thrown up while the shutter
// is open, with all layers written as OpenEXR.
//   bench_film [--json FILE]
#include <filesystem>
#include <string>

#include <fmt/format.h>

#include "services/rendering/exr.h"
#include "services/rendering/film_camera.h"
#include "services/rendering/film_take.h"
#include "tests/bench/bench_inputs.h"
#include "tests/bench/bench_report.h"
#include "workers/cvt/indicator.h"
#include "workers/cvt/tessellate.h"

namespace vorocast::bench {
namespace {

constexpr double kGoalCpuSeconds = 4;  // two seconds on two cores
constexpr double kShutter = 0.5;

/// A take of two instants, 1/25 s apart.
geometry::TrackedTake TwoInstants(geometry::Cells cells) {
  geometry::TrackedTake take;
  take.model = {std::move(cells), 0, {}, 1};
  take.model.patch.assign(take.cell_count(), 0);
  take.patches.frames = {0, 1};
  take.patches.patch_count = 1;
  take.patches.world_from_template.resize(2);
  take.patches.state.resize(2);
  take.cell_rotation.assign(2 * take.cell_count(), Eigen::Vector4f(1, 0, 0, 0));
  take.cell_translation.assign(2 * take.cell_count(), geometry::Vec3::Zero());
  return take;
}

absl::Status Measure(const geometry::TrackedTake& take, const std::string& name, const std::string& input, BenchReport& report) {
  double azimuth_deg = 0;
  rendering::Bounds bounds = rendering::BoundsOf(take, azimuth_deg);
  RETURN_IF_ERROR(rendering::Settle(bounds));
  const rendering::Camera camera = rendering::CameraForFilm(bounds, azimuth_deg, 1920, 1080);
  const rendering::Studio studio{.ground = bounds.ground, .extent = bounds.extent};
  const geometry::SimulatedTake simulated = rendering::AsSimulated(take);
  const ScratchFolder folder("film");
  std::filesystem::create_directories(folder.path());
  const std::filesystem::path path = folder.path() / "picture.exr";
  const double begin = CpuSeconds();
  const rendering::FilmSubject subject = rendering::SubjectOf(take.model, simulated, {}, 0, kShutter);
  ASSIGN_OR_RETURN(const rendering::FilmPicture picture, rendering::RenderFilmPicture(subject, camera, studio, {.shutter = kShutter}, {}));
  const double rendered = CpuSeconds();
  RETURN_IF_ERROR(rendering::WriteExr(path, picture, camera, take.model.patch, {}));
  const double written = CpuSeconds();
  std::size_t covered = 0;
  for (const auto& pixel : picture.rgba) covered += pixel[3] > 0 ? 1 : 0;
  report.Add({.name = name,
              .input = input,
              .cpu_s = written - begin,
              .quality = {{"render_s", rendered - begin},
                          {"exr_s", written - rendered},
                          {"file_mb", static_cast<double>(std::filesystem::file_size(path)) / 1e6},
                          {"covered_percent", 100.0 * static_cast<double>(covered) / static_cast<double>(picture.rgba.size())}},
              .goal = {{"cpu_s", kGoalCpuSeconds}}});
  return absl::OkStatus();
}

absl::Status Run(BenchReport& report) {
  ASSIGN_OR_RETURN(const BenchFrame frame, CraneOrSynthFrame(0, kPaperPoints));
  ASSIGN_OR_RETURN(const cvt::Shape shape, cvt::ShapeFromPoints(frame.points, {}, nullptr));
  cvt::TessellateOptions options;
  options.cells = 5000;
  ASSIGN_OR_RETURN(geometry::Cells cells, cvt::Tessellate(shape, options, nullptr, {}));
  geometry::TrackedTake take = TwoInstants(std::move(cells));
  RETURN_IF_ERROR(Measure(take, "film-1080p-still", frame.name, report));
  geometry::Box3 box;
  for (const geometry::Vec3& centroid : take.model.cells.centroid) box.extend(centroid);
  for (std::size_t c = 0; c < take.cell_count(); ++c) {
    if (take.model.cells.centroid[c].y() > box.center().y()) take.cell_translation[take.cell_count() + c].y() = 0.1;  // 2.5 m/s
  }
  return Measure(take, "film-1080p-moving", frame.name, report);
}

}  // namespace
}  // namespace vorocast::bench

int main(int argc, char** argv) { return vorocast::bench::RunBench("bench_film", argc, argv, vorocast::bench::Run); }
