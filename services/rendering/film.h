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
#include "services/rendering/camera.h"
#include "services/rendering/sheet.h"
#include "services/rendering/studio.h"

/// Pictures for film: linear light, layers for compositing, motion blur.
namespace vorocast::rendering {

/// One cell or scene object at the instants that a picture needs.
struct Motion {
  geometry::Rigid3 at_open;   // world from template (or object), when the shutter opens
  geometry::Rigid3 at_close;  // when it closes
  geometry::Rigid3 at_next;   // one picture later than it opens: for motion vectors
};

/// A cell that is there once more, paler.
struct FilmCopy {
  std::int32_t cell = 0;
  Motion motion;
  float scale = 1;
};

/// A polyhedron that is no cell of the template any more, with the colour and the name of one.
struct FilmShape {
  geometry::TriangleMesh mesh;  // about its middle, as the shutter opens
  Motion motion;
  std::int32_t cell = 0;
};

/// What stands before the camera. n cells.
struct FilmSubject {
  const geometry::Cells* cells = nullptr;
  const std::vector<std::int32_t>* patch = nullptr;
  const std::vector<geometry::Vec3f>* colour = nullptr;  // [n] linear; null: by patch
  std::vector<Motion> motion;                            // [n]
  std::vector<geometry::CellState> state;                // [n]: kGone cells are not drawn
  std::vector<float> scale;                              // [n] size about the centroid, or empty
  std::vector<FilmCopy> copies;
  std::vector<FilmShape> shapes;
  std::vector<std::pair<const geometry::SceneObject*, Motion>> objects;
  double seconds_per_picture = 0.04;
};

/// A mean colour a cell, linear, from the nearest of the captured surface points; empty where they have no colours.
std::vector<geometry::Vec3f> ColoursFromCapture(const geometry::Cells& cells);

/// One picture's layers, top row first, width*height pixels each.
struct FilmPicture {
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::vector<std::array<float, 4>> rgba;     // linear, premultiplied; A is how much of the pixel cells and objects cover
  std::vector<geometry::Vec3f> shadow;        // what of the light the ground keeps, 0 … 1: multiply it with whatever lies behind
  std::vector<float> depth;                   // metres along the camera's axis; infinite where nothing is
  std::vector<geometry::Vec3f> normal;        // world, unit, towards the camera; zero where nothing is
  std::vector<geometry::Vec3f> velocity;      // world, metres a second
  std::vector<std::array<float, 2>> forward;  // pixels to the right and up until the next picture
  std::vector<std::int32_t> cell;             // nearest one, or −1; objects are kObjectId − number
  std::vector<std::int32_t> patch;            // of that cell, or −1

  /// How much of a pixel each thing covers, sorted by coverage, largest first, then by id: what Cryptomatte is written from.
  struct Coverage {
    std::int32_t id = 0;  // a cell, or kObjectId − number of a scene object
    float part = 0;       // 0 … 1
  };
  std::vector<std::array<Coverage, 6>> coverage;  // unused entries have part 0
};
inline constexpr std::int32_t kObjectId = -2;

struct FilmQuality {
  int samples = 4;       // camera rays a pixel; pixels with edges or motion get four times as many
  double shutter = 0.5;  // part of the time between two pictures that it is open, 0 … 1; 0: no motion blur
};

/// Ray-traces one picture. The same bytes for the same input on machines of one kind, single-threaded.
/// INVALID_ARGUMENT for arrays of different lengths, poses that are not finite, or more than 200 million pixels.
absl::StatusOr<FilmPicture> RenderFilmPicture(const FilmSubject& subject, const Camera& camera, const Studio& studio, const FilmQuality& quality,
                                              const base::Progress& progress);

/// The picture on the studio's backdrop, in sRGB: what a preview shows.
Image Develop(const FilmPicture& picture);

}  // namespace vorocast::rendering
