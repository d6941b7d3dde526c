// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rpc/tokens.h"

#include <openssl/crypto.h>
#include <openssl/rand.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <sstream>

#include <fmt/format.h>

namespace vorocast::rpc {
namespace {

constexpr std::size_t kTokensFileBytesMax = 1 << 20;
constexpr std::size_t kRandomBytes = 32;
/// So that scanners for leaked secrets can know one.
constexpr std::string_view kTokenPrefix = "vorocast_";

absl::StatusOr<std::string> ReadBounded(const std::filesystem::path& path, std::size_t bytes_max) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) return absl::InvalidArgumentError(fmt::format("{}: is a folder", path.string()));
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::NotFoundError(fmt::format("{}: cannot be opened", path.string()));
  std::string text(bytes_max + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (text.size() > bytes_max) return absl::InvalidArgumentError(fmt::format("{}: has more than {} bytes", path.string(), bytes_max));
  return text;
}

absl::StatusOr<TokenEntry> ParseLine(const std::string& line) {
  std::istringstream fields(line);
  std::string roles, sha256, more;
  TokenEntry entry;
  if (!(fields >> entry.name >> roles >> sha256) || fields >> more) {
    return absl::InvalidArgumentError("a line is NAME ROLE[,ROLE...] SHA256, as 'vorocast token new' prints it");
  }
  RETURN_IF_ERROR(CheckTokenName(entry.name));
  ASSIGN_OR_RETURN(entry.roles, RolesFromNames(roles));
  ASSIGN_OR_RETURN(entry.sha256, base::Digest::FromHex(sha256));
  return entry;
}

}  // namespace

absl::Status CheckTokenName(std::string_view name) {
  const bool right = !name.empty() && name.size() <= kTokenNameMax && std::all_of(name.begin(), name.end(), [](unsigned char c) {
    return c < 128 && (std::isalnum(c) || c == '.' || c == '_' || c == '-' || c == '@');
  });
  if (right) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format("a token's name has 1 to {} letters, digits, '.', '_', '-' and '@'", kTokenNameMax));
}

absl::StatusOr<std::vector<TokenEntry>> ParseTokens(std::string_view text) {
  std::vector<TokenEntry> entries;
  std::istringstream lines{std::string(text)};
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '#') continue;
    absl::StatusOr<TokenEntry> entry = ParseLine(line);
    if (!entry.ok()) return base::Annotate(entry.status(), fmt::format("line {}", number));
    entries.push_back(*std::move(entry));
    if (entries.size() > kTokenEntriesMax) return absl::InvalidArgumentError(fmt::format("has more than {} tokens", kTokenEntriesMax));
  }
  return entries;
}

absl::StatusOr<std::vector<TokenEntry>> ReadTokens(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const std::string text, ReadBounded(path, kTokensFileBytesMax));
  auto entries = ParseTokens(text);
  if (!entries.ok()) return base::Annotate(entries.status(), path.string());
  return entries;
}

absl::StatusOr<NewToken> MakeToken(const std::string& name, const Roles& roles) {
  RETURN_IF_ERROR(CheckTokenName(name));
  if (roles == Roles()) return absl::InvalidArgumentError("a token needs a role: submit, operate, work or read");
  base::Digest random;
  static_assert(sizeof(random.bytes) == kRandomBytes);
  if (RAND_bytes(random.bytes.data(), kRandomBytes) != 1) return absl::UnavailableError("the system gives no random numbers");
  NewToken made;
  made.token = std::string(kTokenPrefix) + random.Hex();
  made.line = fmt::format("{} {} {}", name, roles.Names(), base::HashBytes(made.token).Hex());
  return made;
}

absl::StatusOr<std::string> ReadToken(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(std::string text, ReadBounded(path, kTokenBytesMax));
  text.resize(std::min(text.find('\n'), text.size()));
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
  const bool right = !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) { return c > 32 && c < 127; });
  if (!right) return absl::InvalidArgumentError(fmt::format("{}: its first line must be a token, as 'vorocast token new' prints it", path.string()));
  return text;
}

const TokenEntry* FindToken(const std::vector<TokenEntry>& entries, std::string_view token) {
  const base::Digest digest = base::HashBytes(token);
  const TokenEntry* found = nullptr;
  for (const TokenEntry& entry : entries) {
    if (CRYPTO_memcmp(entry.sha256.bytes.data(), digest.bytes.data(), digest.bytes.size()) == 0) found = &entry;
  }
  return found;
}

}  // namespace vorocast::rpc
