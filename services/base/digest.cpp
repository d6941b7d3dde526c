// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/base/digest.h"

#include <openssl/evp.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <vector>

#include <fmt/format.h>
#include "services/base/check.h"

namespace vorocast::base {

std::string Digest::Hex() const {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string hex;
  hex.reserve(2 * bytes.size());
  for (std::uint8_t byte : bytes) {
    hex.push_back(kDigits[byte >> 4]);
    hex.push_back(kDigits[byte & 15]);
  }
  return hex;
}

absl::StatusOr<Digest> Digest::FromHex(std::string_view hex) {
  Digest digest;
  if (hex.size() != 2 * digest.bytes.size()) return absl::InvalidArgumentError(fmt::format("a digest has 64 hexadecimal digits, not {}", hex.size()));
  const auto value = [](char c) { return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1; };
  for (std::size_t i = 0; i < digest.bytes.size(); ++i) {
    const int high = value(hex[2 * i]);
    const int low = value(hex[2 * i + 1]);
    if (high < 0 || low < 0) return absl::InvalidArgumentError("a digest has only the digits 0-9 and a-f");
    digest.bytes[i] = static_cast<std::uint8_t>(16 * high + low);
  }
  return digest;
}

struct Hasher::Context {
  EVP_MD_CTX* md = EVP_MD_CTX_new();
  ~Context() { EVP_MD_CTX_free(md); }
};

Hasher::Hasher() : context_(std::make_unique<Context>()) { VOROCAST_CHECK(EVP_DigestInit_ex(context_->md, EVP_sha256(), nullptr) == 1); }
Hasher::~Hasher() = default;
Hasher::Hasher(Hasher&&) noexcept = default;
Hasher& Hasher::operator=(Hasher&&) noexcept = default;

Hasher& Hasher::Update(std::string_view bytes) {
  VOROCAST_CHECK(EVP_DigestUpdate(context_->md, bytes.data(), bytes.size()) == 1);
  return *this;
}

Hasher& Hasher::UpdateField(std::string_view field) { return Update(fmt::format("{}:", field.size())).Update(field); }

Digest Hasher::Finish() {
  Digest digest;
  VOROCAST_CHECK(EVP_DigestFinal_ex(context_->md, digest.bytes.data(), nullptr) == 1);
  return digest;
}

Digest HashBytes(std::string_view bytes) { return Hasher().Update(bytes).Finish(); }

absl::StatusOr<Digest> HashFile(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::NotFoundError(fmt::format("{}: cannot be opened: {}", path.string(), std::strerror(errno)));
  Hasher hasher;
  std::vector<char> block(1 << 20);
  while (file) {
    file.read(block.data(), static_cast<std::streamsize>(block.size()));
    hasher.Update({block.data(), static_cast<std::size_t>(file.gcount())});
  }
  if (file.bad()) return absl::DataLossError(fmt::format("{}: reading failed", path.string()));
  return hasher.Finish();
}

}  // namespace vorocast::base
