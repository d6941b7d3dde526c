// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace vorocast::simulation {

/// Costs of giving each row a column, row-major, rows ≤ columns, all finite. Single precision: 5000 cells are 100 MB as it is.
struct CostMatrix {
  std::size_t rows = 0;
  std::size_t columns = 0;
  std::vector<float> cost;  // [rows*columns]
  float At(std::size_t row, std::size_t column) const { return cost[row * columns + column]; }
};

/// The column of each row so that no column is given twice and the sum of costs is the least there is (Jonker and Volgenant, 1987: reduction of
/// columns and rows, then shortest augmenting paths). The same answer on every run. [rows]
std::vector<std::int32_t> OptimalAssignment(const CostMatrix& costs);

}  // namespace vorocast::simulation
