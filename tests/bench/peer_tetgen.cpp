// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/bench/peer_tetgen.h"

#include <fmt/format.h>
#include <tetgen.h>

#include <exception>
#include <string>

namespace vorocast::bench {
namespace {

/// tetgenio frees what it holds.
void Fill(tetgenio& in, const geometry::TriangleMesh& surface) {
  in.firstnumber = 0;
  in.numberofpoints = static_cast<int>(surface.vertices.size());
  in.pointlist = new REAL[3 * surface.vertices.size()];
  for (std::size_t i = 0; i < surface.vertices.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) in.pointlist[3 * i + axis] = surface.vertices[i][static_cast<Eigen::Index>(axis)];
  }
  in.numberoffacets = static_cast<int>(surface.triangles.size());
  in.facetlist = new tetgenio::facet[surface.triangles.size()];
  for (std::size_t f = 0; f < surface.triangles.size(); ++f) {
    tetgenio::facet& facet = in.facetlist[f];
    tetgenio::init(&facet);
    facet.numberofpolygons = 1;
    facet.polygonlist = new tetgenio::polygon[1];
    tetgenio::init(facet.polygonlist);
    facet.polygonlist[0].numberofvertices = 3;
    facet.polygonlist[0].vertexlist = new int[3];
    for (std::size_t i = 0; i < 3; ++i) facet.polygonlist[0].vertexlist[i] = surface.triangles[f][i];
  }
}

Tetrahedra ResultOf(const tetgenio& out) {
  Tetrahedra result;
  for (int i = 0; i < out.numberofpoints; ++i) {
    const REAL* x = out.pointlist + 3 * static_cast<std::ptrdiff_t>(i);
    result.vertices.emplace_back(x[0], x[1], x[2]);
  }
  for (int t = 0; t < out.numberoftetrahedra; ++t) {
    const int* corner = out.tetrahedronlist + static_cast<std::ptrdiff_t>(t) * out.numberofcorners;
    result.tetrahedra.push_back({corner[0], corner[1], corner[2], corner[3]});
  }
  return result;
}

}  // namespace

absl::StatusOr<Tetrahedra> TetGenMesh(const geometry::TriangleMesh& surface, double volume_max_m3) {
  tetgenio in;
  Fill(in, surface);
  tetgenio out;
  try {
    std::string switches = fmt::format("pq1.4a{:.12f}Q", volume_max_m3);
    tetrahedralize(switches.data(), &in, &out);
  } catch (const std::exception& error) {
    return absl::InternalError(fmt::format("TetGen: {}", error.what()));
  } catch (int code) {
    return absl::InternalError(fmt::format("TetGen: code {}; the surface may cross itself", code));
  }
  return ResultOf(out);
}

}  // namespace vorocast::bench
