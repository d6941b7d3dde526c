// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/plan/film.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace vorocast::plan {
namespace {

constexpr double kPicturesMax = tasks::kFramesMax;

double NumberOr(const nlohmann::json& effect, const char* field, double otherwise) {
  const auto found = effect.find(field);
  return found != effect.end() && found->is_number() ? found->get<double>() : otherwise;
}

/// "take" stands for the take's own duration and rate.
double Instants(const JobSpec& job, const std::vector<PlannedFrame>& frames) {
  if (job.effect.is_null()) return static_cast<double>(frames.size());
  const double take_s = (frames.back().number - frames.front().number) / job.frames_per_second;
  const double duration_s = std::max(NumberOr(job.effect, "duration_s", take_s), NumberOr(job.effect, "duration_min_s", 0));
  return std::floor(duration_s * NumberOr(job.effect, "output_fps", job.frames_per_second) + 1e-6) + 1;
}

}  // namespace

std::int32_t FilmPictures(const JobSpec& job, const std::vector<PlannedFrame>& frames) {
  return static_cast<std::int32_t>(std::min(Instants(job, frames), kPicturesMax + 1));
}

absl::StatusOr<std::vector<PlannedTask>> Film(const JobSpec& job, const std::vector<PlannedFrame>& frames, const std::string& tracked,
                                              const std::string& simulated) {
  const std::int32_t pictures = FilmPictures(job, frames);
  if (pictures > kPicturesMax) {
    return absl::ResourceExhaustedError(fmt::format("a film has at most {} pictures; shorten the effect or lower its output_fps", kPicturesMax));
  }
  std::vector<PlannedTask> film;
  PlannedTask movie{.name = "film: encode", .kind = tasks::Kind::kEncode, .output = "film.mp4"};
  movie.options = tasks::ToJson(tasks::EncodeOptions{
      .frames_per_second = job.effect.is_null() ? job.frames_per_second : NumberOr(job.effect, "output_fps", job.frames_per_second)});
  for (std::int32_t i = 0; i < pictures; ++i) {
    PlannedTask& picture = film.emplace_back();
    picture.name = fmt::format("picture {}: render", i);
    picture.kind = tasks::Kind::kRender;
    picture.options = tasks::ToJson(tasks::RenderOptions{.film = *job.film, .instant = i});
    picture.inputs.push_back({.role = "tracked", .task = tracked, .extension = ".h5"});
    if (!simulated.empty()) picture.inputs.push_back({.role = "simulated", .task = simulated, .extension = ".h5"});
    picture.output = fmt::format("film/picture_{:06}.exr", i);
    // A picture that cannot be rendered is no reason to have no movie: the one before it is shown for it.
    movie.inputs.push_back({.role = "picture", .frame = i, .task = picture.name, .extension = ".exr", .optional = true});
  }
  film.push_back(std::move(movie));
  return film;
}

}  // namespace vorocast::plan
