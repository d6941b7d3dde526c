// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/polyhedra.h"

#include <fmt/format.h>

#include <algorithm>

#include "workers/cvt/face_loops.h"

namespace vorocast::cvt {
namespace {

using geometry::Vec3;

/// Numbers vertices by their keys in the order in which they are first asked for (open addressing; nothing depends on the hash's order).
class VertexTable {
 public:
  VertexTable(std::size_t expected, std::vector<Vec3>* vertices) : vertices_(*vertices), slots_(64) {
    while (slots_.size() < 2 * expected) slots_.resize(2 * slots_.size());
  }

  std::int32_t Number(const VertexKey& key, const Vec3& position) {
    if (2 * (used_ + 1) > slots_.size()) Grow();
    Slot& slot = Find(key);
    if (slot.vertex < 0) {
      slot = {key, static_cast<std::int32_t>(vertices_.size())};
      vertices_.push_back(position);
      ++used_;
    }
    return slot.vertex;
  }

 private:
  struct Slot {
    VertexKey key;
    std::int32_t vertex = -1;
  };
  Slot& Find(const VertexKey& key) {
    std::uint64_t hash = static_cast<std::uint64_t>(key.kind) + 1;
    for (std::int32_t id : key.id) {
      hash = (hash ^ static_cast<std::uint32_t>(id)) * 0x9e3779b97f4a7c15ULL;
      hash ^= hash >> 29;
    }
    std::size_t at = hash & (slots_.size() - 1);
    while (slots_[at].vertex >= 0 && !(slots_[at].key == key)) at = (at + 1) & (slots_.size() - 1);
    return slots_[at];
  }
  void Grow() {
    std::vector<Slot> old(2 * slots_.size());
    old.swap(slots_);
    for (const Slot& slot : old) {
      if (slot.vertex >= 0) Find(slot.key) = slot;
    }
  }

  std::vector<Vec3>& vertices_;
  std::vector<Slot> slots_;
  std::size_t used_ = 0;
};

class Assembler {
 public:
  Assembler(const ClippedCells& clipped, const ClippedComplex& complex, geometry::Cells* cells)
      : clipped_(clipped),
        complex_(complex),
        cells_(*cells),
        first_cell_(static_cast<std::int32_t>(cells->size())),
        table_(complex.corners.size() / 6 + 7 * complex.sites.size(), &cells->vertices),
        number_of_(clipped.solid().vertices.size(), -1) {}

  absl::Status Run() {
    if (cells_.face_offset.empty()) cells_.face_offset.push_back(0);
    if (cells_.vertex_offset.empty()) cells_.vertex_offset.push_back(0);
    SortPieces();
    cells_.vertices.reserve(cells_.vertices.size() + clipped_.solid().vertices.size() + complex_.corners.size() / 4 + 7 * complex_.sites.size());
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(complex_.sites.size()); ++i) {
      if (!AppendCell(i)) return absl::InternalError(fmt::format("the outlines of cell {}'s faces do not close", first_cell_ + i));
    }
    return absl::OkStatus();
  }

 private:
  void SortPieces() {
    piece_begin_.assign(complex_.sites.size() + 1, 0);
    for (const auto& piece : complex_.pieces) ++piece_begin_[piece.cell + 1];
    for (std::size_t i = 1; i < piece_begin_.size(); ++i) piece_begin_[i] += piece_begin_[i - 1];
    std::vector<std::int64_t> next(piece_begin_.begin(), piece_begin_.end() - 1);
    piece_order_.resize(complex_.pieces.size());
    for (std::size_t p = 0; p < complex_.pieces.size(); ++p) piece_order_[next[complex_.pieces[p].cell]++] = static_cast<std::int32_t>(p);
  }

  bool AppendCell(std::int32_t site) {
    const VoronoiDiagram::Cell& cell = clipped_.diagram().cell(site);
    const auto names = clipped_.diagram().names(cell);
    const Moments& m = clipped_.moments()[site];
    cells_.sites.push_back(complex_.sites[site]);
    cells_.centroid.push_back(m.volume > 0 ? Vec3(complex_.sites[site] + m.first / m.volume) : complex_.sites[site]);
    cells_.boundary.push_back(clipped_.boundary()[site]);

    outline_.resize(std::max<std::size_t>(outline_.size(), names.size()));
    for (std::size_t p = 0; p < names.size(); ++p) outline_[p].clear();
    surface_.clear();
    surface_begin_.assign(1, 0);
    AddPieces(site);
    if (clipped_.boundary()[site] || m.volume > 0) AddEdges(site);
    for (std::size_t p = 0; p < names.size(); ++p) {
      if (outline_[p].empty()) continue;
      if (!ChainLoops(outline_[p], &loops_)) return false;
      const Vec3& normal = clipped_.diagram().planes(cell)[p].p;
      for (const Loop& polygon : SimplePolygons(std::move(loops_), cells_.vertices, normal)) AppendFace(polygon, first_cell_ + names[p]);
    }
    for (std::size_t f = 0; f + 1 < surface_begin_.size(); ++f) {
      AppendFace({surface_.data() + surface_begin_[f], surface_begin_[f + 1] - surface_begin_[f]}, -1);
    }
    cells_.face_offset.push_back(static_cast<std::int64_t>(cells_.neighbour.size()));
    cells_.volume.push_back(LastVolume());
    return true;
  }

  /// Of the polyhedron just stored, so that it agrees with its stored corners to the last digits; in a sliver of a cell, welded corners may
  /// differ from those its moments were taken of in the tenth.
  double LastVolume() const {
    const Vec3& site = cells_.sites.back();
    double six_volumes = 0;
    for (std::int64_t f = cells_.face_offset[cells_.face_offset.size() - 2]; f < cells_.face_offset.back(); ++f) {
      const std::int32_t* v = cells_.vertex.data() + cells_.vertex_offset[f];
      const std::int64_t size = cells_.vertex_offset[f + 1] - cells_.vertex_offset[f];
      const Vec3 a = cells_.vertices[v[0]] - site;
      for (std::int64_t k = 1; k + 1 < size; ++k) six_volumes += a.dot((cells_.vertices[v[k]] - site).cross(cells_.vertices[v[k + 1]] - site));
    }
    return six_volumes / 6;
  }

  void AppendFace(std::span<const std::int32_t> polygon, std::int32_t neighbour) {
    cells_.vertex.insert(cells_.vertex.end(), polygon.begin(), polygon.end());
    cells_.vertex_offset.push_back(static_cast<std::int64_t>(cells_.vertex.size()));
    cells_.neighbour.push_back(neighbour);
  }

  std::int32_t MeshVertex(std::int32_t vertex) {
    std::int32_t& number = number_of_[vertex];
    if (number < 0) {
      number = static_cast<std::int32_t>(cells_.vertices.size());
      cells_.vertices.push_back(clipped_.solid().vertices[vertex]);
    }
    return number;
  }

  /// The surface in the cell; its edges on bisectors, the other way round, outline the faces there.
  void AddPieces(std::int32_t site) {
    const auto names = clipped_.diagram().names(clipped_.diagram().cell(site));
    for (std::int64_t p = piece_begin_[site]; p < piece_begin_[site + 1]; ++p) {
      const ClippedComplex::Piece& piece = complex_.pieces[piece_order_[p]];
      const std::size_t begin = surface_.size();
      if (piece.corner_count == 0) {
        for (std::int32_t v : clipped_.solid().triangles[piece.triangle]) surface_.push_back(MeshVertex(v));
      }
      for (std::int32_t c = 0; c < piece.corner_count; ++c) {
        const ClippedComplex::Corner& corner = complex_.corners[piece.corner_begin + c];
        surface_.push_back(corner.key.kind == VertexKey::kMeshVertex ? MeshVertex(corner.key.id[0]) : table_.Number(corner.key, corner.position));
      }
      surface_begin_.push_back(surface_.size());
      for (std::int32_t c = 0; c < piece.corner_count; ++c) {
        const std::int32_t across = complex_.corners[piece.corner_begin + c].across;
        if (across < 0) continue;
        const std::int32_t here = surface_[begin + c];
        const std::int32_t there = surface_[begin + (c + 1) % piece.corner_count];
        outline_[std::ranges::find(names, across) - names.begin()].push_back({there, here});
      }
    }
  }

  /// An end of an edge that lies in the solid: with `times` 1 the edge's part in the solid begins there, with −1 it ends there.
  void AddEnd(std::int32_t site, std::size_t v, std::span<const VoronoiDiagram::Corner> corners, std::span<const std::int32_t> names, double at,
              std::int32_t times) {
    if (times == 0) return;
    std::int32_t& vertex = number_of_corner_[v];
    if (vertex < 0) {
      const VoronoiDiagram::Corner& corner = corners[v];
      VertexKey key{VertexKey::kVoronoiVertex, {site, names[corner.plane[0]], names[corner.plane[1]], names[corner.plane[2]]}};
      std::ranges::sort(key.id);
      vertex = table_.Number(key, complex_.sites[site] + corner.position);
    }
    std::vector<OnEdge>& list = times > 0 ? enters_ : leaves_;
    list.insert(list.end(), static_cast<std::size_t>(std::abs(times)), {at, vertex});
  }

  /// The parts of the cell's edges in the solid.
  void AddEdges(std::int32_t site) {
    const VoronoiDiagram::Cell& cell = clipped_.diagram().cell(site);
    const auto names = clipped_.diagram().names(cell);
    const auto corners = clipped_.diagram().corners(cell);
    const std::int64_t begin = complex_.winding_begin[site];
    number_of_corner_.assign(corners.size(), -1);
    const auto winding = [&](std::size_t v) { return begin < 0 ? 1 : complex_.winding[begin + static_cast<std::int64_t>(v)]; };
    for (std::size_t v = 0; v < corners.size(); ++v) {
      for (int s = 0; s < 3; ++s) {
        const std::size_t w = corners[v].next[s];
        if (v > w) continue;
        const std::int32_t right = corners[v].plane[(s + 1) % 3];
        const std::int32_t left = corners[v].plane[(s + 2) % 3];
        enters_.clear();
        leaves_.clear();
        AddEnd(site, v, corners, names, 0, winding(v));
        CollectCrossings(site, names[left], names[right], corners[v].position, corners[w].position);
        AddEnd(site, w, corners, names, 2, -winding(w));
        // Sorted along the edge, entering and leaving alternate; their numbers agree by the corners' winding.
        std::ranges::sort(enters_, {}, &OnEdge::at);
        std::ranges::sort(leaves_, {}, &OnEdge::at);
        for (std::size_t k = 0; k < std::min(enters_.size(), leaves_.size()); ++k) {
          outline_[left].push_back({enters_[k].vertex, leaves_[k].vertex});
          outline_[right].push_back({leaves_[k].vertex, enters_[k].vertex});
        }
      }
    }
  }

  /// The crossings of the edge v→w, which runs counter-clockwise around the face with `left`.
  void CollectCrossings(std::int32_t site, std::int32_t left, std::int32_t right, const Vec3& v, const Vec3& w) {
    for (std::int64_t c = complex_.crossing_begin[site]; c < complex_.crossing_begin[site + 1]; ++c) {
      const EdgeCrossing& crossing = complex_.crossings[c];
      const bool leaves = crossing.from == left && crossing.to == right;
      if (!leaves && !(crossing.from == right && crossing.to == left)) continue;
      VertexKey key{VertexKey::kTriangle, {site, left, right, -1}};
      std::sort(key.id.begin(), key.id.begin() + 3);
      key.id = {crossing.triangle, key.id[0], key.id[1], key.id[2]};
      const double length = (w - v).squaredNorm();
      const double at = length > 0 ? std::clamp((crossing.position - v).dot(w - v) / length, 0.0, 1.0) : 0.5;
      (leaves ? leaves_ : enters_).push_back({at, table_.Number(key, complex_.sites[site] + crossing.position)});
    }
  }

  struct OnEdge {
    double at;
    std::int32_t vertex;
  };

  const ClippedCells& clipped_;
  const ClippedComplex& complex_;
  geometry::Cells& cells_;
  const std::int32_t first_cell_;
  VertexTable table_;                      // of all vertices but the mesh's
  std::vector<std::int32_t> number_of_;    // [mesh vertices] or −1
  std::vector<std::int64_t> piece_begin_;  // [n+1]
  std::vector<std::int32_t> piece_order_;

  // Of the cell under way.
  std::vector<std::int32_t> number_of_corner_;     // [corners] or −1
  std::vector<std::vector<OutlineEdge>> outline_;  // [planes]
  std::vector<std::int32_t> surface_;              // vertices of the surface pieces
  std::vector<std::size_t> surface_begin_;
  std::vector<OnEdge> enters_, leaves_;
  std::vector<Loop> loops_;
};

}  // namespace

absl::Status AppendPolyhedra(const ClippedCells& clipped, const ClippedComplex& complex, geometry::Cells* cells) {
  return Assembler(clipped, complex, cells).Run();
}

}  // namespace vorocast::cvt
