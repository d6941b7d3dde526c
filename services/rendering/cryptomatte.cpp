// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/cryptomatte.h"

#include <bit>

#include <fmt/format.h>
#include <murmurhash.h>
#include <nlohmann/json.hpp>

namespace vorocast::rendering {
namespace {

std::uint32_t Murmur3(std::string_view name) {
  std::uint32_t hash = 0;
  lmmh_x86_32(name.data(), static_cast<unsigned int>(name.size()), 0, &hash);
  return hash;
}

}  // namespace

std::uint32_t CryptomatteHash(std::string_view name) {
  const std::uint32_t hash = Murmur3(name);
  // An exponent of all zeros or all ones is a denormal, an infinity or no number; the specification flips its lowest bit.
  const std::uint32_t exponent = (hash >> 23) & 255;
  return exponent == 0 || exponent == 255 ? hash ^ (1U << 23) : hash;
}

float CryptomatteId(std::string_view name) { return std::bit_cast<float>(CryptomatteHash(name)); }

CryptomatteMetadata MakeMetadata(const std::string& layer, const std::vector<std::string>& names) {
  nlohmann::ordered_json manifest = nlohmann::ordered_json::object();
  for (const std::string& name : names) manifest[name] = fmt::format("{:08x}", CryptomatteHash(name));
  return {fmt::format("cryptomatte/{}/", fmt::format("{:08x}", Murmur3(layer)).substr(0, 7)), layer,
          manifest.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)};
}

}  // namespace vorocast::rendering
