// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/interchange/pieces.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>

namespace vorocast::interchange {
namespace {

using geometry::CellMorphs;
using geometry::Rigid3;
using geometry::Vec3;

geometry::Quat RotationOf(const Eigen::Vector4f& q) { return geometry::Quat(q[0], q[1], q[2], q[3]).normalized(); }

void AddCopies(const MovingCells& take, std::vector<Piece>& pieces) {
  const geometry::CellCopies& copies = take.copies;
  if (copies.offset.empty()) return;
  std::map<std::pair<std::int32_t, std::int32_t>, Piece> found;
  for (std::size_t s = 0; s < take.instant_count(); ++s) {
    for (auto row = static_cast<std::size_t>(copies.offset[s]); row < static_cast<std::size_t>(copies.offset[s + 1]); ++row) {
      if (copies.scale[row] > 0) found[{copies.copy[row], copies.cell[row]}].row.emplace_back(s, row);
    }
  }
  for (auto& [key, piece] : found) {
    piece.copy = key.first;
    piece.cell = key.second;
    piece.shape = static_cast<std::size_t>(piece.cell);
    piece.first = piece.row.front().first;
    piece.last = piece.row.back().first;
    pieces.push_back(std::move(piece));
  }
}

void AddPairs(const MovingCells& take, std::vector<Piece>& pieces) {
  const CellMorphs& morph = take.morph;
  const std::size_t count = morph.source.size();
  for (std::size_t p = 0; p < count; ++p) {
    const auto is_there = [&](std::size_t s) { return morph.blend[s * count + p] > 0; };
    Piece piece{.cell = morph.source[p], .pair = static_cast<std::int32_t>(p), .shape = take.cell_count() + p};
    while (piece.first < take.instant_count() && !is_there(piece.first)) ++piece.first;
    if (piece.first == take.instant_count() || morph.triangle_offset[p] == morph.triangle_offset[p + 1]) continue;
    piece.last = take.instant_count() - 1;
    while (!is_there(piece.last)) --piece.last;
    pieces.push_back(std::move(piece));
  }
}

CellShape ShapeOfPair(const CellMorphs& morph, std::size_t pair) {
  CellShape shape;
  shape.vertices.assign(morph.from.begin() + morph.vertex_offset[pair], morph.from.begin() + morph.vertex_offset[pair + 1]);
  shape.vertices_to.assign(morph.to.begin() + morph.vertex_offset[pair], morph.to.begin() + morph.vertex_offset[pair + 1]);
  for (auto t = static_cast<std::size_t>(morph.triangle_offset[pair]); t < static_cast<std::size_t>(morph.triangle_offset[pair + 1]); ++t)
    shape.faces.push_back({.loop = {morph.triangles[t].begin(), morph.triangles[t].end()}, .skin = true});
  return shape;
}

Placement PlacementOfCopy(const MovingCells& take, const Piece& piece, std::size_t instant) {
  // The last row up to the instant; before the first one, that.
  auto at = std::ranges::upper_bound(piece.row, instant, {}, &std::pair<std::size_t, std::size_t>::first);
  if (at != piece.row.begin()) --at;
  const std::size_t row = at->second;
  const Rigid3 pose{RotationOf(take.copies.rotation[row]), take.copies.translation[row].cast<double>()};
  return {{pose.rotation, pose * take.model.cells.centroid[static_cast<std::size_t>(piece.cell)]}, at->first == instant ? take.copies.scale[row] : 0};
}

Placement PlacementOfPair(const MovingCells& take, const Piece& piece, std::size_t instant) {
  const CellMorphs& morph = take.morph;
  const std::size_t pairs = morph.source.size();
  const auto p = static_cast<std::size_t>(piece.pair);
  const std::size_t near = std::clamp(instant, piece.first, piece.last) * pairs + p;
  const bool is_there = morph.blend[instant * pairs + p] > 0;
  return {{RotationOf(morph.rotation[near]), morph.translation[near].cast<double>()}, is_there ? morph.scale[near] : 0, morph.blend[near]};
}

}  // namespace

std::string Piece::Name() const {
  if (pair >= 0) return fmt::format("pair_{:05d}", pair);
  return copy >= 0 ? fmt::format("copy_{:03d}_cell_{:05d}", copy, cell) : fmt::format("cell_{:05d}", cell);
}

std::vector<Piece> PiecesOf(const MovingCells& take) {
  std::vector<Piece> pieces;
  const std::size_t last = take.instant_count() - 1;
  for (std::size_t c = 0; c < take.cell_count(); ++c) pieces.push_back({.cell = static_cast<std::int32_t>(c), .shape = c, .last = last});
  AddCopies(take, pieces);
  AddPairs(take, pieces);
  return pieces;
}

std::vector<CellShape> ShapesOf(const MovingCells& take) {
  std::vector<CellShape> shapes;
  for (std::size_t c = 0; c < take.cell_count(); ++c) shapes.push_back(ShapeOfCell(take.model.cells, c));
  for (std::size_t p = 0; p < take.morph.source.size(); ++p) shapes.push_back(ShapeOfPair(take.morph, p));
  return shapes;
}

Placement PlacementOf(const MovingCells& take, const Piece& piece, std::size_t instant) {
  if (piece.pair >= 0) return PlacementOfPair(take, piece, instant);
  if (piece.copy >= 0) return PlacementOfCopy(take, piece, instant);
  const auto cell = static_cast<std::size_t>(piece.cell);
  return {WorldFromShape(take, instant, cell), take.Size(instant, cell)};
}

Vec3 WorldVertex(const CellShape& shape, const Placement& placement, std::size_t vertex) {
  const double blend = placement.blend;
  const Vec3 x = shape.vertices_to.empty() ? shape.vertices[vertex] : Vec3((1 - blend) * shape.vertices[vertex] + blend * shape.vertices_to[vertex]);
  return placement.world_from_shape * (static_cast<double>(placement.size) * x);
}

}  // namespace vorocast::interchange
