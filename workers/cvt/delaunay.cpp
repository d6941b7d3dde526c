// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/delaunay.h"

#include <fmt/format.h>
#include <tetgen.h>

#include <algorithm>

namespace vorocast::cvt {

absl::StatusOr<std::vector<std::vector<std::int32_t>>> DelaunayNeighbours(const std::vector<geometry::Vec3>& points) {
  if (points.size() < 4) return absl::InvalidArgumentError(fmt::format("{} points have no Delaunay tetrahedron; four are needed", points.size()));
  tetgenio in;
  in.firstnumber = 0;
  in.numberofpoints = static_cast<int>(points.size());
  in.pointlist = new REAL[3 * points.size()];  // freed by tetgenio
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t a = 0; a < 3; ++a) in.pointlist[3 * i + a] = points[i][static_cast<Eigen::Index>(a)];
  }
  tetgenio out;
  try {
    char switches[] = "Q";
    tetrahedralize(switches, &in, &out);
  } catch (const std::exception& error) {
    return absl::InvalidArgumentError(fmt::format("TetGen cannot tetrahedrise {} points: {}", points.size(), error.what()));
  } catch (int code) {
    return absl::InvalidArgumentError(fmt::format("TetGen cannot tetrahedrise {} points: code {}; they may lie in one plane", points.size(), code));
  }
  if (out.numberoftetrahedra == 0) {
    return absl::InvalidArgumentError(fmt::format("TetGen finds no tetrahedron between {} points; they lie in one plane", points.size()));
  }
  std::vector<std::vector<std::int32_t>> neighbours(points.size());
  for (int t = 0; t < out.numberoftetrahedra; ++t) {
    const int* corner = out.tetrahedronlist + static_cast<std::ptrdiff_t>(t) * out.numberofcorners;
    for (int a = 0; a < 4; ++a) {
      for (int b = 0; b < 4; ++b) {
        if (a != b) neighbours[corner[a]].push_back(corner[b]);
      }
    }
  }
  for (auto& list : neighbours) {
    std::ranges::sort(list);
    const auto repeated = std::ranges::unique(list);
    list.erase(repeated.begin(), repeated.end());
  }
  return neighbours;
}

}  // namespace vorocast::cvt
