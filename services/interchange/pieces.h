// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "services/interchange/moving_cells.h"

namespace vorocast::interchange {

/// One thing of a take that moves and whose faces never change: a cell, a copy of one (time persistence), or a pair: a cell on its way into one of
/// another take (morphing). What every format writes is the list of these.
struct Piece {
  std::int32_t cell = -1;                                // whose shape it has; of a pair the cell that it was, −1 where it grows from nothing
  std::int32_t copy = -1;                                // the copy of the performer that it belongs to; −1: none
  std::int32_t pair = -1;                                // of take.morph; −1: none
  std::size_t shape = 0;                                 // in ShapesOf(take)
  std::size_t first = 0;                                 // instants at which it is there lie between these, both included;
  std::size_t last = 0;                                  // cells have the whole take, even where they are gone
  std::vector<std::pair<std::size_t, std::size_t>> row;  // of a copy: an instant at which it is there, and its row in take.copies; ascending

  /// "cell_00042", "copy_003_cell_00042", "pair_00042".
  std::string Name() const;
};

/// All cells, in order; then the copies, by copy and cell; then the pairs. Copies and pairs that are never there are left out.
std::vector<Piece> PiecesOf(const MovingCells& take);

/// The shapes that pieces refer to: of the cells, then of all pairs of the morph.
std::vector<CellShape> ShapesOf(const MovingCells& take);

/// Where a piece is at an instant, and how large: x_world = world_from_shape * (size * ((1 − blend) vertices + blend vertices_to)).
struct Placement {
  geometry::Rigid3 world_from_shape;
  float size = 0;   // 0: it is not there; the pose is then that of the nearest instant at which it was
  float blend = 0;  // of pairs
};
Placement PlacementOf(const MovingCells& take, const Piece& piece, std::size_t instant);

/// The place of one of its vertices in the world.
geometry::Vec3 WorldVertex(const CellShape& shape, const Placement& placement, std::size_t vertex);

}  // namespace vorocast::interchange
