// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>

#include "services/base/status.h"

namespace vorocast::report {

/// A captured frame's file, given as bytes, as a small PNG. Made for frames that the pipeline has refused: draws what can be drawn, whatever its
/// normals and its unit are; the longer of the y and z axes counts as up. Errors say why nothing can be drawn.
absl::StatusOr<std::string> DrawFrame(const std::string& bytes, const std::string& extension);

}  // namespace vorocast::report
