// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

/// Cryptomatte 1.2.0 (Friedman and Jones 2015): mattes by name, as pairs of hashed name and coverage.
namespace vorocast::rendering {

/// MurmurHash3 of the name, changed where its bits would be no ordinary float.
std::uint32_t CryptomatteHash(std::string_view name);
/// The same bits as the float that stands in the picture.
float CryptomatteId(std::string_view name);

/// Header entries "cryptomatte/<id>/name" and so on, of one layer.
struct CryptomatteMetadata {
  std::string prefix;    // "cryptomatte/1a2b3c4/"
  std::string name;      // of the layer: "CryptoCell"
  std::string manifest;  // JSON: {"cell_00000":"89abcdef", …}
};
CryptomatteMetadata MakeMetadata(const std::string& layer, const std::vector<std::string>& names);

}  // namespace vorocast::rendering
