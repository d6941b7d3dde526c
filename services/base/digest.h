// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "services/base/status.h"

namespace vorocast::base {

/// A SHA-256 digest: the name of a blob (digest of its bytes) or of an artifact (digest of what makes it).
struct Digest {
  std::array<std::uint8_t, 32> bytes{};

  auto operator<=>(const Digest&) const = default;
  /// 64 lower-case hexadecimal digits.
  std::string Hex() const;
  /// The first eight digits, for people.
  std::string Short() const { return Hex().substr(0, 8); }
  /// INVALID_ARGUMENT unless `hex` is exactly 64 lower-case hexadecimal digits; so a parsed digest is always safe in a path.
  static absl::StatusOr<Digest> FromHex(std::string_view hex);

  template <typename H>
  friend H AbslHashValue(H h, const Digest& d) {
    return H::combine(std::move(h), d.bytes);
  }
};

/// Incremental SHA-256 (OpenSSL).
class Hasher {
 public:
  Hasher();
  ~Hasher();
  Hasher(Hasher&&) noexcept;
  Hasher& operator=(Hasher&&) noexcept;

  Hasher& Update(std::string_view bytes);
  /// Length-prefixed, so that ("ab","c") and ("a","bc") differ.
  Hasher& UpdateField(std::string_view field);
  /// May be called once.
  Digest Finish();

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

Digest HashBytes(std::string_view bytes);
/// Reads the file in blocks. NOT_FOUND or the read error, with the path.
absl::StatusOr<Digest> HashFile(const std::filesystem::path& path);

}  // namespace vorocast::base
