// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/cvt/cgal_poisson.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Poisson_reconstruction_function.h>
#include <CGAL/property_map.h>
#include <fmt/format.h>

#include <exception>
#include <utility>
#include <vector>

namespace vorocast::cvt {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using PointWithNormal = std::pair<Kernel::Point_3, Kernel::Vector_3>;
using PoissonFunction = CGAL::Poisson_reconstruction_function<Kernel>;

std::vector<PointWithNormal> ToCgal(const geometry::OrientedPoints& points) {
  std::vector<PointWithNormal> converted;
  converted.reserve(points.size());
  for (std::size_t p = 0; p < points.size(); ++p) {
    const geometry::Vec3& x = points.positions[p];
    const geometry::Vec3& n = points.normals[p];
    converted.emplace_back(Kernel::Point_3(x[0], x[1], x[2]), Kernel::Vector_3(n[0], n[1], n[2]));
  }
  return converted;
}

}  // namespace

absl::StatusOr<ScalarGrid> SampleCgalPoisson(const GridFrame& frame, const geometry::OrientedPoints& points) {
  try {
    const std::vector<PointWithNormal> converted = ToCgal(points);
    PoissonFunction function(converted.begin(), converted.end(), CGAL::First_of_pair_property_map<PointWithNormal>(),
                             CGAL::Second_of_pair_property_map<PointWithNormal>());
    if (!function.compute_implicit_function()) return absl::InternalError("CGAL's Poisson solver failed; use the spectral method");
    ScalarGrid grid{frame, std::vector<float>(frame.size())};
    // Neighbouring queries one after another: each starts from the tetrahedron the last one ended in. Rows run back and forth for that.
    for (std::int32_t i = 0; i < frame.nodes[0]; ++i) {
      for (std::int32_t j = 0; j < frame.nodes[1]; ++j) {
        for (std::int32_t step = 0; step < frame.nodes[2]; ++step) {
          const std::int32_t k = (i + j) % 2 == 0 ? step : frame.nodes[2] - 1 - step;
          const geometry::Vec3 x = frame.origin + frame.spacing * geometry::Vec3(i, j, k);
          grid.value[frame.Index(i, j, k)] = -static_cast<float>(function(Kernel::Point_3(x[0], x[1], x[2])));
        }
      }
    }
    return grid;
  } catch (const std::exception& error) {
    return absl::InternalError(fmt::format("CGAL's Poisson solver failed: {}; use the spectral method", error.what()));
  }
}

}  // namespace vorocast::cvt
