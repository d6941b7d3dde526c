// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "services/simulation/cell_graph.h"

namespace vorocast::simulation {

/// Heat on the graph of cells (paper, section 6.1.2): (∂/∂τ + M⁻¹ L) F = 0 with the weighted graph Laplacian L. The paper's own is
/// combinatorial, every weight and mass 1; the geometric one has face area over distance and the cells' volumes, each divided by its mean, so
/// that τ means the same for both.
///
/// F(τ) = exp(−τ M⁻¹ L) F(0) is computed as a Chebyshev series of the symmetric form M^-½ L M^-½: exact to rounding for any τ, no step that could
/// be too long, no eigenvectors. Nothing leaks between components, because L has no entry between them.
class HeatGraph {
 public:
  enum class Weights : std::uint8_t { kGraph, kGeometric };
  /// `volume`: of the cells, [n].
  HeatGraph(const std::vector<CellEdge>& edges, const std::vector<double>& volume, Weights weights);

  /// exp(−τ M⁻¹ L) F. `held`, empty or [n]: cells whose temperature stays as it is.
  std::vector<double> Diffuse(const std::vector<double>& temperature, double tau, const std::vector<bool>& held = {}) const;

 private:
  void Apply(const std::vector<double>& x, const std::vector<bool>& held, std::vector<double>& y) const;

  std::vector<double> root_mass_;  // [n]
  // M^-½ L M^-½, rows compressed.
  std::vector<std::size_t> row_;      // [n+1]
  std::vector<std::int32_t> column_;  // neighbours
  std::vector<double> value_;         // positive: what is subtracted
  std::vector<double> diagonal_;      // [n]
  double largest_ = 0;                // no eigenvalue exceeds it (Gershgorin)
};

}  // namespace vorocast::simulation
