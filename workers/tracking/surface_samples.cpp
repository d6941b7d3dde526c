// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/tracking/surface_samples.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vorocast::tracking {
namespace {

using geometry::Vec3;

struct Facet {
  Vec3 centre;
  Vec3 area;  // area times outward normal
};

/// Cuts a triangle along its longest edge until the pieces are no larger than `area_max`.
void AddTriangle(const Vec3& a, const Vec3& b, const Vec3& c, double area_max, std::vector<Facet>& facets) {
  const Vec3 area = 0.5 * (b - a).cross(c - a);
  if (area.norm() <= area_max) {
    if (area.norm() > 0) facets.push_back({(a + b + c) / 3, area});
    return;
  }
  const double ab = (b - a).squaredNorm();
  const double bc = (c - b).squaredNorm();
  const double ca = (a - c).squaredNorm();
  if (ab >= bc && ab >= ca) {
    const Vec3 m = (a + b) / 2;
    AddTriangle(a, m, c, area_max, facets);
    AddTriangle(m, b, c, area_max, facets);
  } else if (bc >= ca) {
    AddTriangle(b, c, a, area_max, facets);
  } else {
    AddTriangle(c, a, b, area_max, facets);
  }
}

std::vector<Facet> SurfaceFacets(const geometry::Cells& cells, std::size_t cell, double area_max) {
  std::vector<Facet> facets;
  for (std::int64_t f = cells.face_offset[cell]; f < cells.face_offset[cell + 1]; ++f) {
    if (cells.neighbour[f] >= 0) continue;
    const std::int64_t begin = cells.vertex_offset[f];
    for (std::int64_t v = begin + 1; v + 1 < cells.vertex_offset[f + 1]; ++v) {
      AddTriangle(cells.vertices[cells.vertex[begin]], cells.vertices[cells.vertex[v]], cells.vertices[cells.vertex[v + 1]], area_max, facets);
    }
  }
  return facets;
}

/// Farthest-point choice of `count` facets, starting from the largest.
std::vector<std::size_t> SpreadFacets(const std::vector<Facet>& facets, std::size_t count) {
  std::vector<double> distance(facets.size(), std::numeric_limits<double>::infinity());
  std::size_t next = 0;
  for (std::size_t i = 1; i < facets.size(); ++i) {
    if (facets[i].area.squaredNorm() > facets[next].area.squaredNorm()) next = i;
  }
  std::vector<std::size_t> chosen;
  while (chosen.size() < count) {
    chosen.push_back(next);
    for (std::size_t i = 0; i < facets.size(); ++i) distance[i] = std::min(distance[i], (facets[i].centre - facets[next].centre).squaredNorm());
    next = static_cast<std::size_t>(std::ranges::max_element(distance) - distance.begin());
    if (distance[next] == 0) break;
  }
  return chosen;
}

/// The facets nearest to each chosen one decide its normal, and the one nearest to their mean its position.
void AddSamples(const std::vector<Facet>& facets, const std::vector<std::size_t>& chosen, const SurfaceSample& home,
                std::vector<SurfaceSample>& samples) {
  std::vector<std::size_t> owner(facets.size());
  std::vector<Vec3> mean(chosen.size(), Vec3::Zero());
  std::vector<Vec3> normal(chosen.size(), Vec3::Zero());
  std::vector<double> area(chosen.size(), 0);
  for (std::size_t i = 0; i < facets.size(); ++i) {
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t c = 0; c < chosen.size(); ++c) {
      const double d = (facets[i].centre - facets[chosen[c]].centre).squaredNorm();
      if (d < nearest) nearest = d, owner[i] = c;
    }
    mean[owner[i]] += facets[i].area.norm() * facets[i].centre;
    normal[owner[i]] += facets[i].area;
    area[owner[i]] += facets[i].area.norm();
  }
  for (std::size_t c = 0; c < chosen.size(); ++c) {
    if (!(area[c] > 0) || normal[c].norm() < 0.2 * area[c]) continue;  // a sliver folded onto itself has no direction
    mean[c] /= area[c];
    std::size_t nearest = chosen[c];
    for (std::size_t i = 0; i < facets.size(); ++i) {
      if (owner[i] == c && (facets[i].centre - mean[c]).squaredNorm() < (facets[nearest].centre - mean[c]).squaredNorm()) nearest = i;
    }
    samples.push_back({facets[nearest].centre, normal[c].normalized(), home.patch, home.cell});
  }
}

}  // namespace

std::vector<SurfaceSample> SampleTemplateSurface(const geometry::Cells& cells, const std::vector<std::int32_t>& patch, double spacing_m) {
  const double area_a_sample = spacing_m * spacing_m;
  std::vector<SurfaceSample> samples;
  for (std::size_t cell = 0; cell < cells.size(); ++cell) {
    const std::vector<Facet> facets = SurfaceFacets(cells, cell, area_a_sample / 8);
    if (facets.empty()) continue;
    double area = 0;
    for (const Facet& facet : facets) area += facet.area.norm();
    const auto count = static_cast<std::size_t>(std::max(1.0, std::round(area / area_a_sample)));
    AddSamples(facets, SpreadFacets(facets, std::min(count, facets.size())),
               {.position = {}, .normal = {}, .patch = patch[cell], .cell = static_cast<std::int32_t>(cell)}, samples);
  }
  return samples;
}

}  // namespace vorocast::tracking
