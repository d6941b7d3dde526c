// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <cstring>

namespace vorocast::cvt {

/// Four numbers that are worked on at once. The compiler's vector extension: plain arithmetic where the processor has no such registers.
using Lanes = double __attribute__((vector_size(32)));
using LaneMask = std::int64_t __attribute__((vector_size(32)));  // −1 where a comparison holds, else 0

inline Lanes Splat(double value) { return Lanes{value, value, value, value}; }

inline Lanes LoadLanes(const double* from) {
  Lanes lanes;
  std::memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}

inline void StoreLanes(const Lanes& lanes, double* to) { std::memcpy(to, &lanes, sizeof(lanes)); }

inline Lanes Max(const Lanes& a, const Lanes& b) { return a > b ? a : b; }

inline double HighestOf(const Lanes& lanes) {
  const double a = lanes[0] > lanes[1] ? lanes[0] : lanes[1];
  const double b = lanes[2] > lanes[3] ? lanes[2] : lanes[3];
  return a > b ? a : b;
}

inline std::int64_t SumOf(const LaneMask& lanes) { return lanes[0] + lanes[1] + lanes[2] + lanes[3]; }

/// A bit for each lane in which the comparison holds.
inline unsigned BitsOf(const LaneMask& lanes) {
#ifdef __AVX__
  return static_cast<unsigned>(__builtin_ia32_movmskpd256(reinterpret_cast<Lanes>(lanes)));
#else
  return static_cast<unsigned>((lanes[0] & 1) | (lanes[1] & 2) | (lanes[2] & 4) | (lanes[3] & 8));
#endif
}

/// The four sums over the lanes of a, b, c and d.
inline Lanes SumsOf(const Lanes& a, const Lanes& b, const Lanes& c, const Lanes& d) {
  const Lanes ab = __builtin_shufflevector(a, b, 0, 4, 2, 6) + __builtin_shufflevector(a, b, 1, 5, 3, 7);
  const Lanes cd = __builtin_shufflevector(c, d, 0, 4, 2, 6) + __builtin_shufflevector(c, d, 1, 5, 3, 7);
  return __builtin_shufflevector(ab, cd, 0, 1, 4, 5) + __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
}

/// Makes the rows of a 4 × 4 matrix its columns.
inline void Transpose(Lanes* a, Lanes* b, Lanes* c, Lanes* d) {
  const Lanes ab_low = __builtin_shufflevector(*a, *b, 0, 4, 2, 6);
  const Lanes ab_high = __builtin_shufflevector(*a, *b, 1, 5, 3, 7);
  const Lanes cd_low = __builtin_shufflevector(*c, *d, 0, 4, 2, 6);
  const Lanes cd_high = __builtin_shufflevector(*c, *d, 1, 5, 3, 7);
  *a = __builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5);
  *b = __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5);
  *c = __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7);
  *d = __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7);
}

}  // namespace vorocast::cvt
