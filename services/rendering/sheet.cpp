// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/sheet.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "services/rendering/camera.h"
#include "services/rendering/picture.h"
#include "services/rendering/scene.h"
#include "services/rendering/stroke_font.h"
#include "services/rendering/subjects.h"

namespace vorocast::rendering {
namespace {

constexpr double kPixelsMax = 2e8;
constexpr geometry::Rgb8 kPaper = {250, 250, 249};
constexpr geometry::Rgb8 kInk = {52, 55, 60};
/// Sheets of many pictures come out about this much wider than high.
constexpr double kSheetRatio = 1.5;

/// Sizes on the sheet, pixels; they grow with the pictures.
struct Grid {
  std::int32_t columns, rows;
  std::int32_t gap;           // around every picture
  std::int32_t label_height;  // of the strip under a picture
  std::int32_t title_height;  // 0 without a title
  std::int32_t picture_width, picture_height;

  std::int32_t Width() const { return gap + columns * (picture_width + gap); }
  std::int32_t Height() const { return title_height + gap + rows * (picture_height + label_height); }
};

Grid LayOut(std::size_t count, const Camera& camera, const SheetLayout& layout) {
  Grid grid{};
  grid.picture_width = camera.width;
  grid.picture_height = camera.height;
  grid.gap = std::max(4, camera.width / 40);
  grid.label_height = std::max(16, camera.width / 12);
  grid.title_height = layout.title.empty() ? 0 : std::max(24, camera.width / 8);
  double best = std::numeric_limits<double>::infinity();
  for (std::int32_t columns = 1; columns <= static_cast<std::int32_t>(count); ++columns) {
    Grid candidate = grid;
    candidate.columns = columns;
    candidate.rows = (static_cast<std::int32_t>(count) + columns - 1) / columns;
    const double holes = static_cast<double>(candidate.columns * candidate.rows) / static_cast<double>(count);
    const double ratio = static_cast<double>(candidate.Width()) / candidate.Height();
    const double cost = std::abs(std::log(ratio / kSheetRatio)) + 1.5 * (holes - 1);
    if (cost >= best) continue;
    best = cost;
    grid.columns = candidate.columns;
    grid.rows = candidate.rows;
  }
  return grid;
}

void Paste(const Image& picture, std::int32_t left, std::int32_t top, Image& sheet) {
  for (std::int32_t row = 0; row < picture.height; ++row) {
    const auto from = picture.rgb.begin() + 3 * static_cast<std::ptrdiff_t>(row) * picture.width;
    const auto to = sheet.rgb.begin() + 3 * (static_cast<std::ptrdiff_t>(top + row) * sheet.width + left);
    std::copy(from, from + 3 * static_cast<std::ptrdiff_t>(picture.width), to);
  }
}

absl::Status CheckLayout(const SheetLayout& layout, std::size_t pictures) {
  if (pictures == 0) return absl::InvalidArgumentError("a sheet needs at least one picture");
  if (layout.picture_width < 16 || layout.picture_width > 8192) {
    return absl::InvalidArgumentError(fmt::format("pictures {} pixels wide: choose 16 to 8192", layout.picture_width));
  }
  if (!(layout.shrink > 0 && layout.shrink <= 1))
    return absl::InvalidArgumentError(fmt::format("a shrink of {}: choose above 0, at most 1", layout.shrink));
  if (!std::isfinite(layout.azimuth_deg.value_or(0)) || !(layout.elevation_deg >= -10 && layout.elevation_deg <= 80)) {
    return absl::InvalidArgumentError(
        fmt::format("a camera at azimuth {}, elevation {}: the elevation goes from -10 to 80", layout.azimuth_deg.value_or(0), layout.elevation_deg));
  }
  return absl::OkStatus();
}

absl::StatusOr<Scene> BuildScene(const PointsPicture& picture, const SheetLayout&) { return Scene::Build(MakeDiscs(picture.points), {}); }
absl::StatusOr<Scene> BuildScene(const CellsPicture& picture, const SheetLayout& layout) {
  return Scene::Build({}, MakeMeshes(picture, layout.shrink));
}

template <typename Picture>
absl::StatusOr<std::vector<Bounds>> BoundsOfEach(const std::vector<Picture>& pictures) {
  std::vector<Bounds> bounds(pictures.size());
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (absl::Status status = CheckPicture(pictures[i]); !status.ok()) return base::Annotate(status, fmt::format("picture {}", i));
    AddBounds(pictures[i], bounds[i]);
  }
  return bounds;
}

absl::StatusOr<Bounds> BoundsOfAll(const std::vector<Bounds>& pictures) {
  Bounds all;
  for (const Bounds& one : pictures) {
    all.centres.insert(all.centres.end(), one.centres.begin(), one.centres.end());
    all.radii.insert(all.radii.end(), one.radii.begin(), one.radii.end());
    all.companions.insert(all.companions.end(), one.companions.begin(), one.companions.end());
    all.debris.insert(all.debris.end(), one.debris.begin(), one.debris.end());
    all.debris_radii.insert(all.debris_radii.end(), one.debris_radii.begin(), one.debris_radii.end());
  }
  RETURN_IF_ERROR(Settle(all));
  return all;
}

/// A sheet of paper with its title and labels, before the pictures are pasted in.
template <typename Picture>
Image Print(const std::vector<Picture>& pictures, const Grid& grid, const std::string& title) {
  Image sheet{.width = grid.Width(), .height = grid.Height(), .rgb = {}};
  const auto pixels = static_cast<std::size_t>(sheet.width) * static_cast<std::size_t>(sheet.height);
  sheet.rgb.reserve(3 * pixels);
  for (std::size_t i = 0; i < pixels; ++i) sheet.rgb.insert(sheet.rgb.end(), kPaper.begin(), kPaper.end());
  const double title_cap = 0.36 * grid.title_height;
  const double text_width = sheet.width - 2.0 * grid.gap;
  if (grid.title_height > 0) {
    DrawText(sheet, grid.gap + 2, 0.42 * grid.title_height, FitText(title, title_cap, text_width), {.cap_height = title_cap, .colour = kInk});
  }
  const double label_cap = 0.32 * grid.label_height;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const auto column = static_cast<std::int32_t>(i) % grid.columns;
    const auto row = static_cast<std::int32_t>(i) / grid.columns;
    const double left = grid.gap + column * (grid.picture_width + grid.gap) + 2.0;
    const double top =
        grid.title_height + grid.gap + row * (grid.picture_height + grid.label_height) + grid.picture_height + 0.25 * grid.label_height;
    DrawText(sheet, left, top, FitText(pictures[i].label, label_cap, grid.picture_width - 4.0), {.cap_height = label_cap, .colour = kInk});
  }
  return sheet;
}

template <typename Picture>
absl::StatusOr<Image> Render(const std::vector<Picture>& pictures, const SheetLayout& layout, const base::Progress& progress) {
  RETURN_IF_ERROR(CheckLayout(layout, pictures.size()));
  ASSIGN_OR_RETURN(const std::vector<Bounds> each, BoundsOfEach(pictures));
  ASSIGN_OR_RETURN(const Bounds bounds, BoundsOfAll(each));
  const double azimuth_deg = layout.azimuth_deg ? *layout.azimuth_deg : ChooseAzimuth(each);
  const Camera camera = FrameBounds(bounds, {.azimuth_deg = azimuth_deg, .elevation_deg = layout.elevation_deg, .width = layout.picture_width});
  const Grid grid = LayOut(pictures.size(), camera, layout);
  if (static_cast<double>(grid.Width()) * grid.Height() > kPixelsMax) {
    return absl::InvalidArgumentError(
        fmt::format("a sheet of {} × {} pixels is too large: ask for fewer or smaller pictures", grid.Width(), grid.Height()));
  }
  Image sheet = Print(pictures, grid, layout.title);
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    ASSIGN_OR_RETURN(const Scene scene, BuildScene(pictures[i], layout));
    const Studio studio{.ground = bounds.ground, .extent = bounds.extent};
    const Image picture = RenderPicture(scene, camera, studio, [&](double fraction) {
      base::Report(progress, (static_cast<double>(i) + fraction) / static_cast<double>(pictures.size()));
    });
    const auto column = static_cast<std::int32_t>(i) % grid.columns;
    const auto row = static_cast<std::int32_t>(i) / grid.columns;
    Paste(picture, grid.gap + column * (grid.picture_width + grid.gap),
          grid.title_height + grid.gap + row * (grid.picture_height + grid.label_height), sheet);
  }
  return sheet;
}

}  // namespace

absl::StatusOr<Image> RenderSheet(const std::vector<PointsPicture>& pictures, const SheetLayout& layout, const base::Progress& progress) {
  return Render(pictures, layout, progress);
}

absl::StatusOr<Image> RenderSheet(const std::vector<CellsPicture>& pictures, const SheetLayout& layout, const base::Progress& progress) {
  return Render(pictures, layout, progress);
}

}  // namespace vorocast::rendering
