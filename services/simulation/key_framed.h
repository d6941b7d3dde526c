// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "services/geometry/vector.h"

namespace vorocast::simulation {

/// A value that may change over time: key frames, straight lines between them, held before the first and after the last. A plain number is
/// one key. Every setting of an effect that may be key-framed is one of these, so that all of them work alike.
template <typename Value>
class KeyFramed {
 public:
  struct Key {
    double t = 0;  // seconds
    Value value{};
  };

  KeyFramed(const Value& constant) : keys_{{0, constant}} {}  // NOLINT(google-explicit-constructor): a plain value is what it mostly is
  /// At least one key; times ascend.
  explicit KeyFramed(std::vector<Key> keys) : keys_(std::move(keys)) {}

  bool is_constant() const { return keys_.size() == 1; }
  const std::vector<Key>& keys() const { return keys_; }

  Value At(double time) const {
    const std::size_t after = After(time);
    if (after == 0) return keys_.front().value;
    if (after == keys_.size()) return keys_.back().value;
    return Between(after, time);
  }

  /// ∫ from 0 to `time`, exactly; `time` is not negative, and keys before 0 count with what they leave at 0.
  Value Integral(double time) const {
    Value sum = 0 * keys_.front().value;
    double from = 0;
    Value at_from = At(0);
    for (const Key& key : keys_) {
      if (key.t <= from) continue;
      if (key.t >= time) break;
      sum += 0.5 * (key.t - from) * (at_from + key.value);
      from = key.t;
      at_from = key.value;
    }
    return sum + 0.5 * (time - from) * (at_from + At(time));
  }

 private:
  std::size_t After(double time) const { return static_cast<std::size_t>(std::ranges::upper_bound(keys_, time, {}, &Key::t) - keys_.begin()); }
  Value Between(std::size_t after, double time) const {
    const Key& a = keys_[after - 1];
    const Key& b = keys_[after];
    const double share = (time - a.t) / (b.t - a.t);
    return (1 - share) * a.value + share * b.value;
  }

  std::vector<Key> keys_;
};

using Scalar = KeyFramed<double>;
using Vector = KeyFramed<geometry::Vec3>;

}  // namespace vorocast::simulation
