// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/face_loops.h"

#include <algorithm>
#include <limits>

namespace vorocast::cvt {
namespace {

using geometry::Vec3;
using Vec2 = Eigen::Vector2d;

double Cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

/// Positive when a, b, c turn left.
double Turn(const Vec2& a, const Vec2& b, const Vec2& c) { return Cross(b - a, c - a); }

/// A loop with its vertices' places in the plane.
struct FlatLoop {
  Loop vertex;
  std::vector<Vec2> at;

  std::size_t size() const { return vertex.size(); }
  double Area() const {
    double twice = 0;
    for (std::size_t i = 1; i + 1 < size(); ++i) twice += Turn(at[0], at[i], at[i + 1]);
    return twice / 2;
  }
  bool Contains(const Vec2& p) const {
    bool inside = false;
    for (std::size_t i = 0, j = size() - 1; i < size(); j = i++) {
      if ((at[i].y() > p.y()) == (at[j].y() > p.y())) continue;
      if (p.x() < at[i].x() + (p.y() - at[i].y()) / (at[j].y() - at[i].y()) * (at[j].x() - at[i].x())) inside = !inside;
    }
    return inside;
  }
};

bool Properly(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  return Turn(a, b, c) * Turn(a, b, d) < 0 && Turn(c, d, a) * Turn(c, d, b) < 0;
}

bool Blocked(const FlatLoop& loop, const Vec2& a, const Vec2& b) {
  for (std::size_t i = 0; i < loop.size(); ++i) {
    if (Properly(a, b, loop.at[i], loop.at[(i + 1) % loop.size()])) return true;
  }
  return false;
}

/// Whether the direction from corner i of a counter-clockwise loop to `target` goes into the loop.
bool GoesInside(const FlatLoop& loop, std::size_t i, const Vec2& target) {
  const std::size_t n = loop.size();
  const Vec2& before = loop.at[(i + n - 1) % n];
  const Vec2& here = loop.at[i];
  const Vec2& after = loop.at[(i + 1) % n];
  const bool left_of_in = Turn(before, here, target) > 0;
  const bool left_of_out = Turn(here, after, target) > 0;
  return Turn(before, here, after) > 0 ? left_of_in && left_of_out : left_of_in || left_of_out;
}

/// Joins a hole to the outline by an edge there and back, the shortest that crosses nothing. False when there is none.
bool Bridge(const std::vector<FlatLoop>& holes, std::size_t h, FlatLoop* outline) {
  const FlatLoop& hole = holes[h];
  double best = std::numeric_limits<double>::infinity();
  std::size_t best_outer = 0;
  std::size_t best_inner = 0;
  for (std::size_t o = 0; o < outline->size(); ++o) {
    for (std::size_t i = 0; i < hole.size(); ++i) {
      const double squared = (outline->at[o] - hole.at[i]).squaredNorm();
      if (squared >= best || !GoesInside(*outline, o, hole.at[i]) || Blocked(*outline, outline->at[o], hole.at[i])) continue;
      if (std::any_of(holes.begin() + static_cast<std::ptrdiff_t>(h), holes.end(),
                      [&](const FlatLoop& other) { return Blocked(other, outline->at[o], hole.at[i]); })) {
        continue;
      }
      best = squared;
      best_outer = o;
      best_inner = i;
    }
  }
  if (best == std::numeric_limits<double>::infinity()) return false;
  FlatLoop joined;
  const auto push = [&](const FlatLoop& from, std::size_t i) {
    joined.vertex.push_back(from.vertex[i]);
    joined.at.push_back(from.at[i]);
  };
  for (std::size_t o = 0; o <= best_outer; ++o) push(*outline, o);
  for (std::size_t i = 0; i <= hole.size(); ++i) push(hole, (best_inner + i) % hole.size());
  for (std::size_t o = best_outer; o < outline->size(); ++o) push(*outline, o);
  *outline = std::move(joined);
  return true;
}

/// Cuts ears off until a triangle is left. What cannot be cut any more (an outline degenerate to rounding) stays one polygon.
void Triangulate(FlatLoop outline, std::vector<Loop>* polygons) {
  while (outline.size() > 3) {
    const std::size_t n = outline.size();
    std::size_t ear = n;
    double best = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t a = (i + n - 1) % n;
      const std::size_t c = (i + 1) % n;
      if (outline.vertex[a] == outline.vertex[c]) continue;
      const double turn = Turn(outline.at[a], outline.at[i], outline.at[c]);
      // Prefer round ears: slivers come from cutting thin ones.
      const double longest = std::max({(outline.at[a] - outline.at[i]).squaredNorm(), (outline.at[c] - outline.at[i]).squaredNorm(),
                                       (outline.at[c] - outline.at[a]).squaredNorm()});
      if (!(turn > best * longest)) continue;
      bool empty = true;
      for (std::size_t k = 0; k < n && empty; ++k) {
        const std::int32_t v = outline.vertex[k];
        if (v == outline.vertex[a] || v == outline.vertex[i] || v == outline.vertex[c]) continue;
        empty = !(Turn(outline.at[a], outline.at[i], outline.at[k]) >= 0 && Turn(outline.at[i], outline.at[c], outline.at[k]) >= 0 &&
                  Turn(outline.at[c], outline.at[a], outline.at[k]) >= 0);
      }
      if (empty) ear = i, best = turn / longest;
    }
    if (ear == n) break;
    polygons->push_back({outline.vertex[(ear + n - 1) % n], outline.vertex[ear], outline.vertex[(ear + 1) % n]});
    outline.vertex.erase(outline.vertex.begin() + static_cast<std::ptrdiff_t>(ear));
    outline.at.erase(outline.at.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  polygons->push_back(outline.vertex);
}

}  // namespace

bool ChainLoops(std::vector<OutlineEdge> edges, std::vector<Loop>* loops) {
  loops->clear();
  while (!edges.empty()) {
    Loop loop{edges.back().from};
    std::int32_t end = edges.back().to;
    edges.pop_back();
    while (end != loop.front()) {
      const auto next = std::ranges::find_if(edges, [&](const OutlineEdge& e) { return e.from == end; });
      if (next == edges.end()) return false;
      loop.push_back(end);
      end = next->to;
      *next = edges.back();
      edges.pop_back();
    }
    if (loop.size() > 2) loops->push_back(std::move(loop));
  }
  return true;
}

std::vector<Loop> SimplePolygons(std::vector<Loop> loops, const std::vector<Vec3>& vertices, const Vec3& normal) {
  if (loops.size() < 2) return loops;
  const Vec3 up = normal.normalized();
  const Vec3 right = up.unitOrthogonal();
  const Vec3 ahead = up.cross(right);
  const Vec3 origin = vertices[loops[0][0]];
  std::vector<FlatLoop> outlines;
  std::vector<FlatLoop> holes;
  for (Loop& loop : loops) {
    FlatLoop flat;
    for (std::int32_t v : loop) flat.at.emplace_back((vertices[v] - origin).dot(right), (vertices[v] - origin).dot(ahead));
    flat.vertex = std::move(loop);
    (flat.Area() < 0 ? holes : outlines).push_back(std::move(flat));
  }
  std::vector<Loop> polygons;
  std::vector<std::vector<FlatLoop>> holes_of(outlines.size());
  for (FlatLoop& hole : holes) {
    std::size_t owner = outlines.size();
    for (std::size_t o = 0; o < outlines.size(); ++o) {
      if (outlines[o].Contains(hole.at[0]) && (owner == outlines.size() || outlines[o].Area() < outlines[owner].Area())) owner = o;
    }
    // A hole without surroundings has no area but for rounding.
    if (owner == outlines.size())
      polygons.push_back(hole.vertex);
    else
      holes_of[owner].push_back(std::move(hole));
  }
  for (std::size_t o = 0; o < outlines.size(); ++o) {
    if (holes_of[o].empty()) {
      polygons.push_back(outlines[o].vertex);
      continue;
    }
    for (std::size_t h = 0; h < holes_of[o].size(); ++h) {
      if (!Bridge(holes_of[o], h, &outlines[o])) polygons.push_back(holes_of[o][h].vertex);
    }
    Triangulate(std::move(outlines[o]), &polygons);
  }
  return polygons;
}

}  // namespace vorocast::cvt
