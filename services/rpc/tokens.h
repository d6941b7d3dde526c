// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "services/base/digest.h"
#include "services/base/status.h"
#include "services/rpc/roles.h"

namespace vorocast::rpc {

/// One line of a tokens file: a name, its roles, and the SHA-256 of the token. The token itself is kept by whom it was given to, and nowhere else.
struct TokenEntry {
  std::string name;
  Roles roles;
  base::Digest sha256;
};

inline constexpr std::size_t kTokenEntriesMax = 1000;
inline constexpr std::size_t kTokenNameMax = 64;
inline constexpr std::size_t kTokenBytesMax = 512;

/// Lines of "NAME ROLE[,ROLE…] SHA256"; empty lines and those that begin with # are skipped. Two lines may have one name: of an old token and its
/// successor. INVALID_ARGUMENT names the line.
absl::StatusOr<std::vector<TokenEntry>> ParseTokens(std::string_view text);
absl::StatusOr<std::vector<TokenEntry>> ReadTokens(const std::filesystem::path& path);

/// Letters, digits, '.', '_', '-' and '@', at most 64.
absl::Status CheckTokenName(std::string_view name);

struct NewToken {
  std::string token;  // 256 random bits
  std::string line;   // for the tokens file
};
absl::StatusOr<NewToken> MakeToken(const std::string& name, const Roles& roles);

/// What a client sends: the first line of its token file. NOT_FOUND or INVALID_ARGUMENT with the path.
absl::StatusOr<std::string> ReadToken(const std::filesystem::path& path);

/// The entry that `token` belongs to, or null. Takes the same time whichever it is.
const TokenEntry* FindToken(const std::vector<TokenEntry>& entries, std::string_view token);

}  // namespace vorocast::rpc
