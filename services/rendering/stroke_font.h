// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "services/geometry/oriented_points.h"
#include "services/rendering/sheet.h"

namespace vorocast::rendering {

/// Where a line of text stands: pixels from the picture's top left.
struct TextStyle {
  double cap_height = 12;  // of a capital letter, pixels
  geometry::Rgb8 colour = {0, 0, 0};
};

/// Pixels that a line of text is wide.
double TextWidth(std::string_view text, double cap_height);

/// The text, or its beginning and "..." where it is wider than `width_max`.
std::string FitText(std::string_view text, double cap_height, double width_max);

/// Draws a line of text with the top left corner of its first capital at (left, top), clipped to the image. The built-in font has the
/// characters 32 to 126; any other is drawn as '?'.
void DrawText(Image& image, double left, double top, std::string_view text, const TextStyle& style);

}  // namespace vorocast::rendering
