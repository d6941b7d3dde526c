// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "services/base/progress.h"
#include "services/base/status.h"
#include "services/geometry/simulated_take.h"

/// Ray-traced pictures (Embree) of points, cells, tracked and simulated frames, and contact sheets of them.
namespace vorocast::rendering {

struct Image {
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::vector<std::uint8_t> rgb;  // [height*width*3], top row first
};

/// Lossless, the same bytes for the same image.
absl::Status WritePng(const std::filesystem::path& path, const Image& image);

/// A captured frame as small discs along the normals, in the capture's colours where it has any.
struct PointsPicture {
  geometry::OrientedPoints points;
  std::string label;
};
/// A cell that is drawn once more, paler.
struct CellCopy {
  std::int32_t cell = 0;  // whose shape it has
  geometry::Rigid3 world_from_template;
  float scale = 1;  // size about the centroid
};
/// A polyhedron that is no template cell any more.
struct LooseShape {
  geometry::TriangleMesh mesh;  // in the world, about its middle
  geometry::Vec3 middle;
  std::int32_t colour_of = 0;  // the cell whose colour it has
};
/// Cells in some pose, slightly shrunk towards their centroids, coloured by patch (or by cell where patch is empty); cut faces darker.
struct CellsPicture {
  const geometry::Cells* cells = nullptr;
  const std::vector<std::int32_t>* patch = nullptr;
  std::vector<geometry::Rigid3> world_from_template;  // [n], or empty for the identity
  std::vector<geometry::CellState> state;             // [n], or empty: kGone cells are not drawn
  std::vector<float> scale;                           // [n] size about the centroid, or empty: as they are
  std::vector<CellCopy> copies;
  std::vector<LooseShape> shapes;
  std::vector<std::pair<const geometry::TriangleMesh*, geometry::Rigid3>> objects;
  std::string label;
};

struct SheetLayout {
  std::int32_t picture_width = 480;  // pixels; height follows from the bounds of all pictures
  std::string title;
  double shrink = 0.92;               // cells are drawn this much of their size, 0 … 1
  std::optional<double> azimuth_deg;  // of the camera around the vertical: 0 looks along −z, 90 along −x; unset: three-quarters from the front
  double elevation_deg = 10;          // of the camera above the horizon, −10 … 80
};

/// One sheet: pictures in reading order, one camera for all (from the bounds of all, without the outermost thousandth of the points and
/// cells, and without what was released and lies far off), ground with soft shadows, a label under each. Labels and title are ASCII; other characters
/// are drawn as '?'. The same bytes for the same input, single-threaded. INVALID_ARGUMENT for no pictures, nothing to draw, values that are not
/// finite, arrays of different lengths, a sheet of more than 200 million pixels.
absl::StatusOr<Image> RenderSheet(const std::vector<PointsPicture>& pictures, const SheetLayout& layout, const base::Progress& progress);
absl::StatusOr<Image> RenderSheet(const std::vector<CellsPicture>& pictures, const SheetLayout& layout, const base::Progress& progress);

}  // namespace vorocast::rendering
