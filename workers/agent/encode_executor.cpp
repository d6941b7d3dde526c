// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/agent/encode_executor.h"

#include <optional>

#include "services/rendering/exr.h"
#include "services/rendering/film.h"
#include "services/rendering/movie.h"
#include "services/tasks/options.h"
#include "workers/agent/task_inputs.h"

namespace vorocast::agent {

absl::Status EncodeExecutor::Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                                     const base::Progress& progress) {
  ASSIGN_OR_RETURN(const auto options, OptionsOf<tasks::EncodeOptions>(spec));
  const std::vector<const tasks::Input*> inputs = InputsOf(spec, "picture");
  std::optional<rendering::MovieWriter> movie;
  rendering::Image image;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    if (inputs[i]->digest) {
      ASSIGN_OR_RETURN(const rendering::FilmPicture picture, rendering::ReadExrBeauty(PathOf(*inputs[i], store)));
      image = rendering::Develop(picture);
    }
    if (image.rgb.empty()) continue;  // nothing to repeat yet
    if (!movie) {
      auto opened = rendering::MovieWriter::Open(output, image.width, image.height, options.frames_per_second);
      if (!opened.ok()) return opened.status();
      movie.emplace(std::move(*opened));
    }
    RETURN_IF_ERROR(movie->Add(image));
    base::Report(progress, static_cast<double>(i + 1) / static_cast<double>(inputs.size()));
  }
  if (!movie) return absl::FailedPreconditionError("no picture was rendered, so there is no movie to make");
  return movie->Finish();
}

}  // namespace vorocast::agent
