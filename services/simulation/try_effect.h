// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

#include "services/base/status.h"

namespace vorocast::simulation {

/// One effect on one tracked.h5, at once and without a scheduler: for artists who turn the knobs of one effect, and for the pictures in docs.
struct TryOptions {
  std::filesystem::path tracked;
  std::filesystem::path onto;   // the second tracked.h5 of a morph, or empty
  std::string effect;           // as LoadEffect takes it
  std::filesystem::path out;    // simulated.h5 to write, or empty
  std::filesystem::path sheet;  // PNG to write, or empty
  double from_s = 0;            // first picture
  int pictures = 12;
  int width = 480;  // of a picture, pixels
};

/// Prints what a step cost and how deep things were in each other.
absl::Status TryEffect(const TryOptions& options);

}  // namespace vorocast::simulation
