// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/starts.h"

#include <algorithm>
#include <cmath>

#include "services/base/random.h"
#include "workers/cvt/x_rays.h"

namespace vorocast::cvt {
namespace {

using geometry::Vec3;

struct LatticePoint {
  Vec3 position;
  double margin;  // to the surface, along x
};

/// All points of the lattice with cubic cell `side` and one point at `origin` (fractions of a cell) that lie in the solid.
std::vector<LatticePoint> LatticePoints(const Solid& solid, const XRays& rays, double side, const Vec3& origin) {
  std::vector<LatticePoint> points;
  std::vector<double> crossings;
  const Vec3 low = solid.box.min();
  const Vec3 size = solid.box.sizes();
  for (int half = 0; half < 2; ++half) {
    const Vec3 first = low + side * (origin - Vec3::Constant(1 - half / 2.0));
    for (double z = first.z(); z < low.z() + size.z(); z += side) {
      for (double y = first.y(); y < low.y() + size.y(); y += side) {
        rays.Crossings(y, z, &crossings);
        for (std::size_t c = 0; c + 1 < crossings.size(); c += 2) {
          const auto begin = std::ceil((crossings[c] - first.x()) / side);
          for (double x = first.x() + begin * side; x < crossings[c + 1]; x += side) {
            points.push_back({{x, y, z}, std::min(x - crossings[c], crossings[c + 1] - x)});
          }
        }
      }
    }
  }
  return points;
}

}  // namespace

std::vector<Vec3> RandomSites(const Solid& solid, std::int32_t count, std::uint64_t seed) {
  const XRays rays(solid.vertices, solid.triangles);
  base::Random random(seed);
  // Rejection in the box.
  std::vector<Vec3> sites;
  std::vector<double> crossings;
  const Vec3 low = solid.box.min();
  const Vec3 size = solid.box.sizes();
  while (sites.size() < static_cast<std::size_t>(count)) {
    Vec3 point;
    for (int a = 0; a < 3; ++a) point[a] = low[a] + size[a] * random.Uniform();
    rays.Crossings(point.y(), point.z(), &crossings);
    const auto beyond = crossings.end() - std::ranges::upper_bound(crossings, point.x());
    if (beyond % 2 == 1) sites.push_back(point);
  }
  return sites;
}

std::vector<Vec3> LatticeSites(const Solid& solid, std::int32_t count, std::uint64_t seed) {
  const XRays rays(solid.vertices, solid.triangles);
  base::Random random(seed);
  const Vec3 origin(random.Uniform(), random.Uniform(), random.Uniform());
  // Two points a cubic cell. Find the widest lattice with enough points; the count is not quite monotone in the spacing, so keep the
  // fewest found.
  const double expected = std::cbrt(2.0) * solid.Spacing(static_cast<std::size_t>(count));
  std::vector<LatticePoint> best;
  double low = expected;
  double high = 1.1 * expected;
  for (int step = 0; step < 60; ++step) {
    std::vector<LatticePoint> points = LatticePoints(solid, rays, low, origin);
    if (points.size() >= static_cast<std::size_t>(count)) {
      best = std::move(points);
      break;
    }
    high = low;
    low *= 0.97;
  }
  for (int step = 0; step < 10 && best.size() > static_cast<std::size_t>(count); ++step) {
    const double middle = (low + high) / 2;
    std::vector<LatticePoint> points = LatticePoints(solid, rays, middle, origin);
    if (points.size() < static_cast<std::size_t>(count)) {
      high = middle;
    } else {
      low = middle;
      if (points.size() < best.size()) best = std::move(points);
    }
  }
  if (best.size() < static_cast<std::size_t>(count)) return RandomSites(solid, count, seed);  // thinner than any lattice plane
  // Leave out those nearest to the surface, where a cell is cut most.
  std::vector<std::size_t> order(best.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto surplus = static_cast<std::ptrdiff_t>(best.size()) - count;
  std::ranges::nth_element(order, order.begin() + surplus,
                           [&](std::size_t a, std::size_t b) { return best[a].margin != best[b].margin ? best[a].margin < best[b].margin : a < b; });
  std::sort(order.begin() + surplus, order.end());
  std::vector<Vec3> sites;
  const double shift = 0.01 * low;
  for (auto i = order.begin() + surplus; i != order.end(); ++i) {
    // Never past the surface along x, so a lattice point stays inside.
    const double room = std::min(shift, best[*i].margin / 2);
    sites.push_back(best[*i].position + Vec3(random.Uniform(-room, room), random.Uniform(-shift, shift), random.Uniform(-shift, shift)));
  }
  return sites;
}

}  // namespace vorocast::cvt
