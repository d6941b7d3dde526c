// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <vector>

#include "services/base/status.h"
#include "services/geometry/simulated_take.h"

/// Files for other programs: one animation of rigid cells, written in each format of the field.
namespace vorocast::interchange {

/// Cells over time, whether tracked or simulated. S instants, n cells, m scene objects; metres, y up, seconds.
struct MovingCells {
  geometry::Template model;
  double frames_per_second = 25;               // of the capture
  std::vector<double> time;                    // [S] seconds from the take's first frame
  std::vector<Eigen::Vector4f> rotation;       // [S*n] w x y z
  std::vector<geometry::Vec3> translation;     // [S*n] world_from_template
  std::vector<geometry::CellState> state;      // [S*n]; all recalled where nothing was simulated
  std::vector<float> scale;                    // [S*n] 0 … 1, or empty: cells keep their size
  geometry::CellCopies copies;                 // time persistence
  geometry::CellMorphs morph;                  // cells on their way into another take's
  std::vector<geometry::SceneObject> objects;  // [m]
  std::vector<geometry::Rigid3> object_pose;   // [S*m] world_from_object

  std::size_t instant_count() const { return time.size(); }
  std::size_t cell_count() const { return model.cells.size(); }
  geometry::Rigid3 Pose(std::size_t instant, std::size_t cell) const;
  geometry::CellState State(std::size_t instant, std::size_t cell) const { return state[instant * cell_count() + cell]; }
  /// About its centroid; 0 for a cell that is gone.
  float Size(std::size_t instant, std::size_t cell) const;
};

/// Reads `take`: a tracked.h5, a simulated.h5, or a folder that holds them, of which the simulated one is taken where there is one. The
/// shapes of a simulated take are in `tracked`; left empty, in the tracked.h5 beside it.
/// NOT_FOUND where there is no take; INVALID_ARGUMENT where the files are something else, or do not belong together.
absl::StatusOr<MovingCells> ReadMovingCells(const std::filesystem::path& take, const std::filesystem::path& tracked);

/// Keeps every n-th instant, from the first; n > 0.
void KeepEvery(std::size_t n, MovingCells& take);

/// One cell's polyhedron about its centroid.
struct CellShape {
  struct Face {
    std::vector<std::int32_t> loop;  // indices into vertices, counter-clockwise seen from outside
    bool skin = false;               // on the surface of the captured shape; else a cut between two cells
    std::int32_t neighbour = -1;     // the cell on the other side of a cut
  };
  std::vector<geometry::Vec3> vertices;     // metres, the centroid is the origin
  std::vector<geometry::Vec3> vertices_to;  // where they go, of a cell that turns into another; else empty
  std::vector<Face> faces;
};
CellShape ShapeOfCell(const geometry::Cells& cells, std::size_t cell);

/// The pose that puts a CellShape (about its centroid) into the world.
geometry::Rigid3 WorldFromShape(const MovingCells& take, std::size_t instant, std::size_t cell);

}  // namespace vorocast::interchange
