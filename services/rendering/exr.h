// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "services/base/status.h"
#include "services/rendering/film.h"

namespace vorocast::rendering {

/// What an OpenEXR file says about itself.
struct FilmMetadata {
  double frames_per_second = 25;
  double seconds = 0;                                         // of the picture's instant, from the take's first frame
  std::vector<std::string> object_names;                      // of the scene objects, in their order
  std::vector<std::pair<std::string, std::string>> comments;  // further header entries: "vorocast/effect", …
};

/// Writes a multi-part OpenEXR file, lossless (ZIP, but PIZ never), the same bytes for the same picture:
///   rgba       R G B A half         premultiplied; A is the coverage of cells and objects
///   depth      Z float              metres along the camera's axis, infinite where nothing is
///   utility    N.XYZ, velocity.XYZ (m/s), forward.u .v (pixels right and up until the next picture), shadow.RGB; half
///   id         cell, patch uint     one more than the index, 0 where nothing is or a scene object
///   crypto     CryptoCell00…02, CryptoPatch00…02 float: Cryptomatte with its manifest in the header
/// `patch`: of each cell. UNAVAILABLE when the file cannot be written.
absl::Status WriteExr(const std::filesystem::path& path, const FilmPicture& picture, const Camera& camera, const std::vector<std::int32_t>& patch,
                      const FilmMetadata& metadata);

/// The rgba and shadow layers of such a file, the rest empty: enough for Develop. INVALID_ARGUMENT for other files.
absl::StatusOr<FilmPicture> ReadExrBeauty(const std::filesystem::path& path);

}  // namespace vorocast::rendering
