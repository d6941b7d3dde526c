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
  cut_.resize(size + 1);
  new_corners_.resize(3 * size + 1);
}

/// Makes room for so many corners, to be filled; positions past them read as zero.
void ConvexCell::Clear(std::int32_t corners) {
  Reserve(corners);
  const std::int32_t old = Padded(count_);
  count_ = corners;
  for (std::int32_t i = count_; i < old; ++i) x_[i] = y_[i] = z_[i] = 0;
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
  Clear(unit.count_);
  for (std::int32_t i = 0; i < count_; ++i) {
    x_[i] = reach * unit.x_[i];
    y_[i] = reach * unit.y_[i];
    z_[i] = reach * unit.z_[i];
    corners_[i] = unit.corners_[i];
  }
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

  FindCrossedEdges();
  if (new_count_ < 3) return false;
  planes_.push_back({p, square});
  names_.push_back(name);
  starting_at_.push_back(-1);
  const bool sound = IsOneLoop();
  if (sound) Link(plane_count() - 1);
  for (std::int32_t m = 0; m < new_count_; ++m) starting_at_[new_corners_[m].b] = -1;
  if (sound) UpdateRadius();
  return sound;
}

/// Lists the corners beyond the plane, and the edges from them to others. Written without branches on the sides, which no processor can guess.
void ConvexCell::FindCrossedEdges() {
  const double* side = side_.data();
  std::int32_t* cut = cut_.data();
  std::int32_t cut_count = 0;
  for (std::int32_t i = 0; i < count_; ++i) {
    cut[cut_count] = i;
    cut_count += side[i] > 0 ? 1 : 0;
  }
  NewCorner* corners = new_corners_.data();
  std::int32_t new_count = 0;
  for (std::int32_t m = 0; m < cut_count; ++m) {
    const Corner& corner = corners_[cut[m]];
    for (int s = 0; s < 3; ++s) {
      NewCorner& u = corners[new_count];
      u.cut = cut[m];
      u.kept = corner.next[s];
      u.b = corner.plane[(s + 1) % 3];
      u.c = corner.plane[(s + 2) % 3];
      new_count += side[corner.next[s]] > 0 ? 0 : 1;
    }
  }
  for (std::int32_t m = 0; m < new_count; ++m) {
    NewCorner& u = corners[m];
    u.index = m < cut_count ? cut[m] : count_ + m - cut_count;
    const double t = -side[u.kept] / (side[u.cut] - side[u.kept]);
    const Vec3 kept = position(u.kept);
    u.position = kept + t * (position(u.cut) - kept);
  }
  cut_count_ = cut_count;
  new_count_ = new_count;
}

/// Whether the new corners form one loop around the new face; if not, rounding has made the part that is cut away something else than a cap.
/// Leaves in starting_at_ where each plane's edge on the new face starts.
bool ConvexCell::IsOneLoop() {
  for (std::int32_t m = 0; m < new_count_; ++m) {
    std::int32_t& start = starting_at_[new_corners_[m].b];
    if (start >= 0) return false;  // a face cannot be crossed twice by one plane
    start = m;
  }
  std::int32_t at = 0;
  for (std::int32_t steps = 1; steps <= new_count_; ++steps) {
    at = starting_at_[new_corners_[at].c];
    if (at < 0) return false;
    if (at == 0) return steps == new_count_;
  }
  return false;
}

/// Puts the new corners in place of those cut away and joins them into the new face's loop.
void ConvexCell::Link(std::int32_t plane) {
  const std::int32_t new_total = count_ + new_count_ - cut_count_;
  for (std::int32_t m = 0; m < new_count_; ++m) {
    // The kept end's link along this edge leaves from its third plane.
    const NewCorner& u = new_corners_[m];
    Corner& kept = corners_[u.kept];
    const auto on_edge = [&](std::int32_t p) { return p == u.b || p == u.c; };
    kept.next[on_edge(kept.plane[0]) ? (on_edge(kept.plane[1]) ? 2 : 1) : 0] = u.index;
  }
  if (static_cast<std::size_t>(Padded(new_total)) > x_.size()) Reserve(new_total);
  for (std::int32_t m = 0; m < new_count_; ++m) {
    const NewCorner& u = new_corners_[m];
    const NewCorner& following = new_corners_[starting_at_[u.c]];
    Corner& corner = corners_[u.index];
    corner.plane = {plane, u.b, u.c};
    corner.next[0] = u.kept;
    corner.next[1] = following.index;
    corners_[following.index].next[2] = u.index;
    x_[u.index] = u.position.x();
    y_[u.index] = u.position.y();
    z_[u.index] = u.position.z();
  }
  if (new_total < count_) FillHoles(new_total);
  count_ = new_total;
}

/// Moves the last corners into the places that more cut than new corners have left empty.
void ConvexCell::FillHoles(std::int32_t new_total) {
  std::int32_t hole = new_count_;  // cut_[new_count_ … cut_count_−1] are empty
  std::int32_t last_hole = cut_count_ - 1;
  for (std::int32_t last = count_ - 1; last >= new_total; --last) {
    if (last_hole >= hole && cut_[last_hole] == last) {
      --last_hole;
    } else {
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
