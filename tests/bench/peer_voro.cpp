// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/bench/peer_voro.h"

#include <algorithm>
#include <cmath>

#include <voro++/voro++.hh>

namespace vorocast::bench {

BoxCells VoroCells(const std::vector<geometry::Vec3>& sites, const geometry::Box3& box) {
  // voro++'s manual: blocks of about five sites are fastest.
  const geometry::Vec3 size = box.sizes();
  const double block = std::cbrt(5 * box.volume() / static_cast<double>(sites.size()));
  const auto blocks = [&](double length) { return std::max(1, static_cast<int>(std::ceil(length / block))); };
  voro::container container(box.min().x(), box.max().x(), box.min().y(), box.max().y(), box.min().z(), box.max().z(), blocks(size.x()),
                            blocks(size.y()), blocks(size.z()), false, false, false, 8);
  for (std::size_t i = 0; i < sites.size(); ++i) container.put(static_cast<int>(i), sites[i].x(), sites[i].y(), sites[i].z());
  BoxCells cells{std::vector<double>(sites.size()), std::vector<geometry::Vec3>(sites.size())};
  voro::voronoicell cell;
  voro::c_loop_all loop(container);
  if (!loop.start()) return cells;
  do {
    if (!container.compute_cell(cell, loop)) continue;
    const auto site = static_cast<std::size_t>(loop.pid());
    geometry::Vec3 offset;
    cell.centroid(offset.x(), offset.y(), offset.z());
    cells.volume[site] = cell.volume();
    cells.centroid[site] = sites[site] + offset;
  } while (loop.inc());
  return cells;
}

}  // namespace vorocast::bench
