// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/assignment.h"

#include <algorithm>
#include <limits>

#include "services/base/check.h"

namespace vorocast::simulation {
namespace {

constexpr std::int32_t kNone = -1;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// v: prices of columns. A row's best column is the one of least cost minus price; prices of columns that nobody has stay 0, which is
/// what makes the answer optimal when there are more columns than rows.
class Solver {
 public:
  explicit Solver(const CostMatrix& costs) : costs_(costs), price_(costs.columns, 0), column_of_(costs.rows, kNone), row_of_(costs.columns, kNone) {}

  std::vector<std::int32_t> Solve() {
    std::vector<std::int32_t> free;
    for (std::size_t row = 0; row < costs_.rows; ++row) free.push_back(static_cast<std::int32_t>(row));
    for (int round = 0; round < 2; ++round) free = ReduceRows(free);
    for (const std::int32_t row : free) Augment(row);
    return column_of_;
  }

 private:
  struct TwoBest {
    std::int32_t first = kNone, second = kNone;
    double least = kInfinity, next = kInfinity;
  };
  TwoBest Best(std::int32_t row) const {
    TwoBest best;
    const float* cost = &costs_.cost[static_cast<std::size_t>(row) * costs_.columns];
    for (std::size_t c = 0; c < costs_.columns; ++c) {
      const double reduced = cost[c] - price_[c];
      if (reduced >= best.next) continue;
      if (reduced < best.least) {
        best.next = best.least;
        best.second = best.first;
        best.least = reduced;
        best.first = static_cast<std::int32_t>(c);
      } else {
        best.next = reduced;
        best.second = static_cast<std::int32_t>(c);
      }
    }
    return best;
  }

  /// Augmenting row reduction: each free row takes its best column and lowers that column's price as far as its second best allows.
  std::vector<std::int32_t> ReduceRows(const std::vector<std::int32_t>& free) {
    std::vector<std::int32_t> left;
    std::vector<std::int32_t> queue(free.rbegin(), free.rend());
    std::size_t budget = 4 * costs_.rows + 16;  // rows may drive each other out for long; paths end it
    while (!queue.empty()) {
      const std::int32_t row = queue.back();
      queue.pop_back();
      if (budget == 0) {
        left.push_back(row);
        continue;
      }
      --budget;
      const TwoBest best = Best(row);
      std::int32_t column = best.first;
      const bool strict = best.next > best.least && best.second != kNone;
      std::int32_t before = row_of_[static_cast<std::size_t>(column)];
      if (strict) {
        price_[static_cast<std::size_t>(column)] -= best.next - best.least;
      } else if (before != kNone && best.second != kNone) {
        column = best.second;
        before = row_of_[static_cast<std::size_t>(column)];
      }
      column_of_[static_cast<std::size_t>(row)] = column;
      row_of_[static_cast<std::size_t>(column)] = row;
      if (before == kNone) continue;
      column_of_[static_cast<std::size_t>(before)] = kNone;
      (strict ? queue : left).push_back(before);
    }
    std::ranges::sort(left);
    return left;
  }

  /// The shortest path from a free row to a column that nobody has (Dijkstra on reduced costs), along which all change.
  void Augment(std::int32_t free_row) {
    const std::size_t n = costs_.columns;
    std::vector<double> distance(n);
    std::vector<std::int32_t> from(n, free_row);
    std::vector<std::int32_t> todo(n);
    std::vector<std::int32_t> scanned;
    for (std::size_t c = 0; c < n; ++c) {
      distance[c] = costs_.At(static_cast<std::size_t>(free_row), c) - price_[c];
      todo[c] = static_cast<std::int32_t>(c);
    }
    std::int32_t end = kNone;
    double shortest = 0;
    while (end == kNone) {
      const auto nearest = std::ranges::min_element(todo, {}, [&](std::int32_t c) { return distance[static_cast<std::size_t>(c)]; });
      const std::int32_t column = *nearest;
      shortest = distance[static_cast<std::size_t>(column)];
      if (row_of_[static_cast<std::size_t>(column)] == kNone) {
        end = column;
        break;
      }
      *nearest = todo.back();
      todo.pop_back();
      scanned.push_back(column);
      const auto row = static_cast<std::size_t>(row_of_[static_cast<std::size_t>(column)]);
      const double offset = costs_.At(row, static_cast<std::size_t>(column)) - price_[static_cast<std::size_t>(column)] - shortest;
      for (const std::int32_t c : todo) {
        const auto other = static_cast<std::size_t>(c);
        const double way = costs_.At(row, other) - price_[other] - offset;
        if (way >= distance[other]) continue;
        distance[other] = way;
        from[other] = static_cast<std::int32_t>(row);
      }
    }
    for (const std::int32_t c : scanned) price_[static_cast<std::size_t>(c)] += distance[static_cast<std::size_t>(c)] - shortest;
    for (std::int32_t column = end; column != kNone;) {
      const std::int32_t row = from[static_cast<std::size_t>(column)];
      const std::int32_t next = column_of_[static_cast<std::size_t>(row)];
      row_of_[static_cast<std::size_t>(column)] = row;
      column_of_[static_cast<std::size_t>(row)] = column;
      column = row == free_row ? kNone : next;
    }
  }

  const CostMatrix& costs_;
  std::vector<double> price_;
  std::vector<std::int32_t> column_of_;
  std::vector<std::int32_t> row_of_;
};

}  // namespace

std::vector<std::int32_t> OptimalAssignment(const CostMatrix& costs) {
  VOROCAST_CHECK(costs.rows <= costs.columns && costs.cost.size() == costs.rows * costs.columns);
  return Solver(costs).Solve();
}

}  // namespace vorocast::simulation
