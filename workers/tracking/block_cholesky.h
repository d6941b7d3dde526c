// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstdint>
#include <vector>

namespace vorocast::tracking {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Sparse Cholesky factorisation of a symmetric matrix of 6×6 blocks, A = L Lᵀ. The pattern is analysed once, for many factorisations: working in
/// blocks is several times as fast as a scalar sparse Cholesky of the same matrix.
class BlockCholesky {
 public:
  /// `pairs` (k < l, each once): the blocks below the diagonal that may differ from zero.
  BlockCholesky(std::int32_t size, const std::vector<std::array<std::int32_t, 2>>& pairs);

  /// Sets every block to zero.
  void Clear();
  /// The whole diagonal block of k; its upper triangle is not read.
  Matrix6& Diagonal(std::int32_t k) { return column_[start_[place_[k]]]; }
  /// Sets the block of rows l, columns k of the given pair (k, l).
  void SetLower(std::size_t pair, const Matrix6& block);

  /// Factorises in place: the blocks are gone afterwards. False when the matrix is not positive definite.
  bool Factorise();
  /// Solves A x = b with the factors, in place. [size]
  void Solve(std::vector<Vector6>& x) const;

 private:
  std::vector<std::int32_t> place_;  // [size] where the elimination order puts each row
  // Columns of L in elimination order, as compressed columns of blocks; the diagonal block first.
  std::vector<std::int32_t> start_;  // [size+1]
  std::vector<std::int32_t> row_;    // [blocks]
  std::vector<Matrix6> column_;      // [blocks]
  struct Entry {
    std::int32_t block;       // where the pair's block lies among the columns
    bool transposed = false;  // the elimination order turned the pair around
  };
  std::vector<Entry> entry_;  // [pairs]
  struct Left {
    std::int32_t column;  // a column k < j whose L_jk is not zero
    std::int32_t block;   // where L_jk lies
  };
  std::vector<std::int32_t> left_start_;  // [size+1]
  std::vector<Left> left_;
  std::vector<std::int32_t> slot_;  // [size] scratch: block of each row in the column at work
};

}  // namespace vorocast::tracking
