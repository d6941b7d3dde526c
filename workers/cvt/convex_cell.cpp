// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/convex_cell.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vorocast::cvt {
namespace {

using Lane = Eigen::Array4d;
using geometry::Vec3;

Eigen::Map<Lane> At(std::vector<double>& values, std::int32_t i) { return Eigen::Map<Lane>(values.data() + i); }

std::int32_t Padded(std::int32_t count) { return (count + 3) & ~3; }

}  // namespace

void ConvexCell::Reserve(std::int32_t corners) {
  const auto wanted = static_cast<std::size_t>(Padded(corners));
  if (x_.size() >= wanted) return;
  const std::size_t size = std::max<std::size_t>(64, 2 * wanted);
  for (auto* values : {&x_, &y_, &z_, &side_}) values->resize(size, 0.0);
  corners_.resize(size);
}

void ConvexCell::StartAsCube(double half_side) {
  planes_.clear();
  names_.clear();
  for (int a = 0; a < 3; ++a) {
    for (double sign : {1.0, -1.0}) {
      planes_.push_back({sign * half_side * Vec3::Unit(a), half_side * half_side});
      names_.push_back(-1);
    }
  }
  Reserve(8);
  count_ = 8;
  for (std::int32_t i = 0; i < 8; ++i) {
    const std::array<std::int32_t, 3> negative{i & 1, (i >> 1) & 1, (i >> 2) & 1};
    x_[i] = negative[0] ? -half_side : half_side;
    y_[i] = negative[1] ? -half_side : half_side;
    z_[i] = negative[2] ? -half_side : half_side;
    corners_[i] = {{negative[0], 2 + negative[1], 4 + negative[2]}, {i ^ 1, i ^ 2, i ^ 4}};
    if ((negative[0] + negative[1] + negative[2]) % 2 == 1) {  // keep n0·(n1×n2) positive
      std::swap(corners_[i].plane[1], corners_[i].plane[2]);
      std::swap(corners_[i].next[1], corners_[i].next[2]);
    }
  }
  starting_at_.assign(planes_.size(), -1);
}

void ConvexCell::DropUnusedPlanes() {
  std::vector<std::int32_t> renumbered(planes_.size(), -1);
  std::int32_t used = 0;
  for (std::int32_t i = 0; i < count_; ++i) {
    for (std::int32_t& p : corners_[i].plane) renumbered[p] = 0;
  }
  for (std::size_t p = 0; p < planes_.size(); ++p) {
    if (renumbered[p] < 0) continue;
    planes_[used] = planes_[p];
    names_[used] = names_[p];
    renumbered[p] = used++;
  }
  planes_.resize(used);
  names_.resize(used);
  for (std::int32_t i = 0; i < count_; ++i) {
    for (std::int32_t& p : corners_[i].plane) p = renumbered[p];
  }
}

const ConvexCell& ConvexCell::UnitDodecahedron() {
  static const ConvexCell cell = [] {
    ConvexCell made;
    made.StartAsCube(2);
    std::int32_t name = -1;
    for (int a = 0; a < 3; ++a) {
      for (double s : {1.0, -1.0}) {
        for (double t : {1.0, -1.0}) {
          Vec3 direction;
          direction[a] = 0;
          direction[(a + 1) % 3] = s;
          direction[(a + 2) % 3] = t * std::numbers::phi;
          made.Cut(direction.normalized(), name--);
        }
      }
    }
    made.DropUnusedPlanes();
    return made;
  }();
  return cell;
}

void ConvexCell::Reset(double reach) {
  const ConvexCell& unit = UnitDodecahedron();
  Reserve(unit.count_);
  // The old cell's positions past the new count must read as zero.
  const std::int32_t old = Padded(count_);
  count_ = unit.count_;
  for (std::int32_t i = 0; i < count_; ++i) {
    x_[i] = reach * unit.x_[i];
    y_[i] = reach * unit.y_[i];
    z_[i] = reach * unit.z_[i];
    corners_[i] = unit.corners_[i];
  }
  for (std::int32_t i = count_; i < old; ++i) x_[i] = y_[i] = z_[i] = 0;
  planes_.resize(unit.planes_.size());
  for (std::size_t p = 0; p < planes_.size(); ++p) planes_[p] = {reach * unit.planes_[p].p, reach * reach};
  names_ = unit.names_;
  starting_at_.assign(planes_.size(), -1);
  radius_squared_ = reach * reach * unit.radius_squared_;
}

bool ConvexCell::Cut(const Vec3& p, std::int32_t name) {
  const double square = p.squaredNorm();
  if (!(square > 0)) return false;
  Lane highest = Lane::Constant(-1);
  for (std::int32_t i = 0; i < count_; i += 4) {
    const Lane side = p.x() * At(x_, i) + p.y() * At(y_, i) + p.z() * At(z_, i) - square;
    At(side_, i) = side;
    highest = highest.max(side);
  }
  if (!(highest.maxCoeff() > 0)) return true;

  cut_.clear();
  for (std::int32_t i = 0; i < count_; ++i) {
    if (side_[i] > 0) cut_.push_back(i);
  }
  new_corners_.clear();
  for (std::int32_t v : cut_) {
    const Corner& corner = corners_[v];
    for (int s = 0; s < 3; ++s) {
      const std::int32_t w = corner.next[s];
      if (side_[w] > 0) continue;
      const double t = -side_[w] / (side_[v] - side_[w]);
      const Vec3 kept = position(w);
      new_corners_.push_back({kept + t * (position(v) - kept), corner.plane[(s + 1) % 3], corner.plane[(s + 2) % 3], w, v, 0});
    }
  }
  if (new_corners_.size() < 3) return false;
  planes_.push_back({p, square});
  names_.push_back(name);
  starting_at_.push_back(-1);
  const bool linked = Link(plane_count() - 1);
  for (const NewCorner& u : new_corners_) starting_at_[u.b] = -1;
  if (linked) UpdateRadius();
  return linked;
}

/// Puts the new corners in place of those cut away and joins them into the new face's loop.
bool ConvexCell::Link(std::int32_t plane) {
  const auto added = static_cast<std::int32_t>(new_corners_.size());
  const auto removed = static_cast<std::int32_t>(cut_.size());
  const std::int32_t new_count = count_ + added - removed;
  for (std::int32_t m = 0; m < added; ++m) {
    NewCorner& u = new_corners_[m];
    u.index = m < removed ? cut_[m] : count_ + m - removed;
    if (starting_at_[u.b] >= 0) return false;  // a face cannot be crossed twice by one plane
    starting_at_[u.b] = m;
  }
  // One loop through all new corners, or the part cut away was not one piece.
  std::int32_t at = 0;
  for (std::int32_t steps = 1;; ++steps) {
    at = starting_at_[new_corners_[at].c];
    if (at < 0 || steps > added) return false;
    if (at == 0) {
      if (steps != added) return false;
      break;
    }
  }
  for (const NewCorner& u : new_corners_) {
    Corner& kept = corners_[u.kept];
    // Not yet overwritten links still name the corner cut away; in a degenerate cell two edges may join the same two corners.
    for (int s = 0; s < 3; ++s) {
      if (kept.next[s] == u.cut && kept.plane[(s + 1) % 3] == u.c && kept.plane[(s + 2) % 3] == u.b) kept.next[s] = -1 - u.index;
    }
  }
  for (const NewCorner& u : new_corners_) {
    for (std::int32_t& next : corners_[u.kept].next) {
      if (next < 0) next = -1 - next;
    }
  }
  Reserve(std::max(count_, new_count));
  for (const NewCorner& u : new_corners_) {
    Corner& corner = corners_[u.index];
    corner.plane = {plane, u.b, u.c};
    corner.next[0] = u.kept;
    x_[u.index] = u.position.x();
    y_[u.index] = u.position.y();
    z_[u.index] = u.position.z();
  }
  for (const NewCorner& u : new_corners_) {
    const std::int32_t following = new_corners_[starting_at_[u.c]].index;
    corners_[u.index].next[1] = following;
    corners_[following].next[2] = u.index;
  }
  if (new_count < count_) FillHoles(new_count);
  count_ = new_count;
  return true;
}

/// Moves the last corners into the places that more cut than new corners have left empty.
void ConvexCell::FillHoles(std::int32_t new_count) {
  const auto added = new_corners_.size();
  std::size_t hole = added;
  const auto is_hole = [&](std::int32_t i) { return std::find(cut_.begin() + static_cast<std::ptrdiff_t>(added), cut_.end(), i) != cut_.end(); };
  for (std::int32_t last = count_ - 1; last >= new_count; --last) {
    if (!is_hole(last)) {
      while (cut_[hole] >= new_count) ++hole;
      const std::int32_t to = cut_[hole++];
      x_[to] = x_[last], y_[to] = y_[last], z_[to] = z_[last];
      corners_[to] = corners_[last];
      for (int s = 0; s < 3; ++s) {
        Corner& neighbour = corners_[corners_[to].next[s]];
        for (int r = 0; r < 3; ++r) {
          if (neighbour.next[r] == last) neighbour.next[r] = to;
        }
      }
    }
    x_[last] = y_[last] = z_[last] = 0;
  }
}

void ConvexCell::UpdateRadius() {
  Lane furthest = Lane::Zero();
  for (std::int32_t i = 0; i < count_; i += 4) {
    furthest = furthest.max(At(x_, i).square() + At(y_, i).square() + At(z_, i).square());
  }
  radius_squared_ = furthest.maxCoeff();
}

}  // namespace vorocast::cvt
