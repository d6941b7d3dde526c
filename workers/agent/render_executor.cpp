// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/agent/render_executor.h"

#include <utility>

#include <fmt/format.h>
#include "services/rendering/exr.h"
#include "services/rendering/film_camera.h"
#include "services/rendering/film_take.h"
#include "services/tasks/options.h"
#include "workers/agent/task_inputs.h"

namespace vorocast::agent {
namespace {

/// Shares of the time, for the progress.
constexpr double kRead = 0.1;
constexpr double kRendered = 0.85;

absl::StatusOr<geometry::SimulatedTake> TakeToRender(const tasks::TaskSpec& spec, const storage::ArtifactStore& store,
                                                     const geometry::TrackedTake& tracked) {
  if (InputsOf(spec, "simulated").empty()) return rendering::AsSimulated(tracked);
  ASSIGN_OR_RETURN(const std::filesystem::path path, PathOfOnly(spec, "simulated", store));
  ASSIGN_OR_RETURN(geometry::SimulatedTake take, storage::ReadSimulatedTake(path));
  if (take.cell_state.size() != take.time.size() * tracked.cell_count()) {
    return absl::InvalidArgumentError("the simulated take has other cells than the tracked one");
  }
  return take;
}

absl::StatusOr<rendering::Camera> CameraOf(const tasks::FilmOptions& film, double seconds, const rendering::Bounds& bounds, double azimuth_deg) {
  if (film.camera.empty()) return rendering::CameraForFilm(bounds, azimuth_deg, film.width, film.height);
  ASSIGN_OR_RETURN(const rendering::CameraPath path, rendering::CameraPathFromJson(film.camera));
  return rendering::CameraAt(path, seconds, film.width, film.height);
}

}  // namespace

absl::Status RenderExecutor::Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                                     const base::Progress& progress) {
  ASSIGN_OR_RETURN(const auto options, OptionsOf<tasks::RenderOptions>(spec));
  ASSIGN_OR_RETURN(const std::filesystem::path tracked_path, PathOfOnly(spec, "tracked", store));
  ASSIGN_OR_RETURN(const geometry::TrackedTake tracked, storage::ReadTrackedTake(tracked_path));
  ASSIGN_OR_RETURN(const geometry::SimulatedTake take, TakeToRender(spec, store, tracked));
  const auto instant = static_cast<std::size_t>(options.instant);
  if (instant >= take.time.size()) {
    return absl::InvalidArgumentError(
        fmt::format("picture {} of a take of {} instants; was it simulated for less time than was asked for?", instant, take.time.size()));
  }
  double azimuth_deg = 0;
  rendering::Bounds bounds = rendering::BoundsOf(tracked, azimuth_deg);
  RETURN_IF_ERROR(rendering::Settle(bounds));
  const double seconds = take.time[instant];
  ASSIGN_OR_RETURN(const rendering::Camera camera, CameraOf(options.film, seconds, bounds, azimuth_deg));
  const std::vector<geometry::Vec3f> colours =
      options.film.colour == "capture" ? rendering::ColoursFromCapture(tracked.model.cells) : std::vector<geometry::Vec3f>();
  const rendering::FilmSubject subject = rendering::SubjectOf(tracked.model, take, colours, instant, options.film.shutter);
  base::Report(progress, kRead);

  const rendering::Studio studio{.ground = bounds.ground, .extent = bounds.extent};
  ASSIGN_OR_RETURN(const rendering::FilmPicture picture,
                   rendering::RenderFilmPicture(subject, camera, studio, {.samples = options.film.samples, .shutter = options.film.shutter},
                                                Part(progress, kRead, kRendered)));
  rendering::FilmMetadata metadata{.frames_per_second = tracked.frames_per_second, .seconds = seconds};
  for (const geometry::SceneObject& object : take.objects) metadata.object_names.push_back(object.name);
  metadata.comments = {{"vorocast/key", spec.Key().Hex()}, {"vorocast/options", spec.options.dump()}};
  if (!take.effect_json.empty()) metadata.comments.emplace_back("vorocast/effect", take.effect_json);
  return rendering::WriteExr(output, picture, camera, tracked.model.patch, metadata);
}

}  // namespace vorocast::agent
