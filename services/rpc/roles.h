// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "services/base/status.h"

namespace vorocast::rpc {

/// What somebody may do. Submit implies read; operate implies submit and read, and allows changing other users' jobs; work is for workers only.
enum class Role : std::uint8_t { kRead = 1, kSubmit = 2, kOperate = 4, kWork = 8 };

/// A set of roles with all that they imply.
class Roles {
 public:
  Roles() = default;
  void Add(Role role);
  bool Has(Role role) const { return (bits_ & static_cast<std::uint8_t>(role)) != 0; }
  /// "operate,submit,read"
  std::string Names() const;
  friend bool operator==(const Roles&, const Roles&) = default;

 private:
  std::uint8_t bits_ = 0;
};

std::string_view Name(Role role);
/// INVALID_ARGUMENT lists the names.
absl::StatusOr<Role> RoleFromName(std::string_view name);
/// Names separated by commas, at least one.
absl::StatusOr<Roles> RolesFromNames(std::string_view names);

/// Who may call a method.
struct Access {
  bool anybody = false;  // without a token: only what tells nothing about the farm's work
  Role least = Role::kOperate;
};
/// For a method as it stands in a call's path, "/vorocast.v1.Jobs/Submit". Nothing for a method that is not listed: nobody may call that.
std::optional<Access> AccessTo(std::string_view method);

}  // namespace vorocast::rpc
