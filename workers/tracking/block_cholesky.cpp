// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/tracking/block_cholesky.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <set>
#include <utility>

namespace vorocast::tracking {
namespace {

/// Where an approximate minimum degree ordering puts each row.
std::vector<std::int32_t> EliminationOrder(std::int32_t size, const std::vector<std::array<std::int32_t, 2>>& pairs) {
  std::vector<Eigen::Triplet<double>> entries;
  for (std::int32_t k = 0; k < size; ++k) entries.emplace_back(k, k, 1);
  for (const auto& [k, l] : pairs) entries.emplace_back(k, l, 1), entries.emplace_back(l, k, 1);
  Eigen::SparseMatrix<double> pattern(size, size);
  pattern.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(pattern, order);
  // indices()[i] is the row that comes i-th.
  std::vector<std::int32_t> place(static_cast<std::size_t>(size));
  for (std::int32_t i = 0; i < size; ++i) place[order.indices()[i]] = i;
  return place;
}

}  // namespace

BlockCholesky::BlockCholesky(std::int32_t size, const std::vector<std::array<std::int32_t, 2>>& pairs) : place_(EliminationOrder(size, pairs)) {
  std::vector<std::set<std::int32_t>> below(static_cast<std::size_t>(size));
  for (const auto& [k, l] : pairs) below[std::min(place_[k], place_[l])].insert(std::max(place_[k], place_[l]));
  // Eliminating a column joins all rows below its diagonal; it is enough to hand them to the first of them.
  for (auto& rows : below) {
    if (!rows.empty()) below[*rows.begin()].insert(std::next(rows.begin()), rows.end());
  }
  start_.push_back(0);
  std::vector<std::vector<Left>> left(static_cast<std::size_t>(size));
  for (std::int32_t j = 0; j < size; ++j) {
    row_.push_back(j);
    for (const std::int32_t i : below[j]) {
      left[i].push_back({j, static_cast<std::int32_t>(row_.size())});
      row_.push_back(i);
    }
    start_.push_back(static_cast<std::int32_t>(row_.size()));
  }
  left_start_.push_back(0);
  for (const auto& columns : left) {
    left_.insert(left_.end(), columns.begin(), columns.end());
    left_start_.push_back(static_cast<std::int32_t>(left_.size()));
  }
  for (const auto& [k, l] : pairs) {
    const std::int32_t column = std::min(place_[k], place_[l]);
    const auto block = std::lower_bound(row_.begin() + start_[column], row_.begin() + start_[column + 1], std::max(place_[k], place_[l]));
    entry_.push_back({static_cast<std::int32_t>(block - row_.begin()), place_[k] > place_[l]});
  }
  column_.resize(row_.size());
  slot_.resize(static_cast<std::size_t>(size));
  Clear();
}

void BlockCholesky::Clear() {
  for (Matrix6& block : column_) block.setZero();
}

void BlockCholesky::SetLower(std::size_t pair, const Matrix6& block) {
  if (entry_[pair].transposed) {
    column_[entry_[pair].block] = block.transpose();
  } else {
    column_[entry_[pair].block] = block;
  }
}

bool BlockCholesky::Factorise() {
  for (std::size_t j = 0; j + 1 < start_.size(); ++j) {
    for (std::int32_t b = start_[j]; b < start_[j + 1]; ++b) slot_[row_[b]] = b;
    // A_ij − Σ_k L_ik L_jkᵀ over the columns k to the left.
    for (std::int32_t e = left_start_[j]; e < left_start_[j + 1]; ++e) {
      const Matrix6 transposed = column_[left_[e].block].transpose();
      for (std::int32_t b = left_[e].block; b < start_[left_[e].column + 1]; ++b)
        column_[slot_[row_[b]]].noalias() -= column_[b].lazyProduct(transposed);
    }
    Matrix6& diagonal = column_[start_[j]];
    const Eigen::LLT<Matrix6> factor(diagonal);
    if (factor.info() != Eigen::Success) return false;
    diagonal = factor.matrixL();
    for (std::int32_t b = start_[j] + 1; b < start_[j + 1]; ++b) {
      diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(column_[b]);
    }
  }
  return true;
}

void BlockCholesky::Solve(std::vector<Vector6>& x) const {
  const auto size = static_cast<std::int32_t>(place_.size());
  std::vector<Vector6> y(x.size());
  for (std::int32_t k = 0; k < size; ++k) y[place_[k]] = x[k];
  for (std::int32_t j = 0; j < size; ++j) {
    column_[start_[j]].triangularView<Eigen::Lower>().solveInPlace(y[j]);
    for (std::int32_t b = start_[j] + 1; b < start_[j + 1]; ++b) y[row_[b]].noalias() -= column_[b] * y[j];
  }
  for (std::int32_t j = size; j-- > 0;) {
    for (std::int32_t b = start_[j] + 1; b < start_[j + 1]; ++b) y[j].noalias() -= column_[b].transpose() * y[row_[b]];
    column_[start_[j]].triangularView<Eigen::Lower>().transpose().solveInPlace(y[j]);
  }
  for (std::int32_t k = 0; k < size; ++k) x[k] = y[place_[k]];
}

}  // namespace vorocast::tracking
