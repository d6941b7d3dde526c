// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rpc/roles.h"

#include <map>

#include <fmt/format.h>

namespace vorocast::rpc {
namespace {

constexpr Role kAllRoles[] = {Role::kOperate, Role::kSubmit, Role::kRead, Role::kWork};

/// Every method of every service that this project serves. A new one is refused to everybody until it stands here.
const std::map<std::string_view, Access>& Table() {
  static const std::map<std::string_view, Access> table = {
      {"/vorocast.v1.Captures/Open", {.least = Role::kSubmit}},
      {"/vorocast.v1.Captures/Missing", {.least = Role::kSubmit}},
      {"/vorocast.v1.Captures/Upload", {.least = Role::kSubmit}},
      {"/vorocast.v1.Captures/Add", {.least = Role::kSubmit}},
      {"/vorocast.v1.Captures/Close", {.least = Role::kSubmit}},
      {"/vorocast.v1.Jobs/Submit", {.least = Role::kSubmit}},
      {"/vorocast.v1.Jobs/Get", {.least = Role::kRead}},
      {"/vorocast.v1.Jobs/List", {.least = Role::kRead}},
      {"/vorocast.v1.Jobs/Watch", {.least = Role::kRead}},
      {"/vorocast.v1.Jobs/Explain", {.least = Role::kRead}},
      {"/vorocast.v1.Jobs/Fetch", {.least = Role::kRead}},
      {"/vorocast.v1.Jobs/Attempts", {.least = Role::kRead}},
      // Their own jobs only; those of others need the role operate (Caller::MayChange).
      {"/vorocast.v1.Jobs/Cancel", {.least = Role::kSubmit}},
      {"/vorocast.v1.Jobs/Retry", {.least = Role::kSubmit}},
      {"/vorocast.v1.Jobs/Pause", {.least = Role::kSubmit}},
      {"/vorocast.v1.Jobs/Resume", {.least = Role::kSubmit}},
      {"/vorocast.v1.Dispatch/Work", {.least = Role::kWork}},
      {"/vorocast.v1.Artifacts/Get", {.least = Role::kWork}},
      {"/vorocast.v1.Artifacts/Put", {.least = Role::kWork}},
      {"/vorocast.v1.Simulation/Effects", {.least = Role::kRead}},
      {"/vorocast.v1.Simulation/Check", {.least = Role::kRead}},
      {"/vorocast.v1.Simulation/Run", {.least = Role::kSubmit}},
      {"/vorocast.v1.Simulation/Live", {.least = Role::kSubmit}},
      {"/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", {.least = Role::kRead}},
      {"/grpc.health.v1.Health/Check", {.anybody = true}},
      {"/grpc.health.v1.Health/Watch", {.anybody = true}},
  };
  return table;
}

}  // namespace

void Roles::Add(Role role) {
  bits_ |= static_cast<std::uint8_t>(role);
  if (role == Role::kOperate) bits_ |= static_cast<std::uint8_t>(Role::kSubmit);
  if (role == Role::kOperate || role == Role::kSubmit) bits_ |= static_cast<std::uint8_t>(Role::kRead);
}

std::string Roles::Names() const {
  std::string names;
  for (const Role role : kAllRoles) {
    if (Has(role)) names += fmt::format("{}{}", names.empty() ? "" : ",", Name(role));
  }
  return names;
}

std::string_view Name(Role role) {
  switch (role) {
    case Role::kRead:
      return "read";
    case Role::kSubmit:
      return "submit";
    case Role::kOperate:
      return "operate";
    case Role::kWork:
      return "work";
  }
  return "";
}

absl::StatusOr<Role> RoleFromName(std::string_view name) {
  for (const Role role : kAllRoles) {
    if (Name(role) == name) return role;
  }
  return absl::InvalidArgumentError(fmt::format("\"{}\" is no role; there are submit, operate, work and read", name));
}

absl::StatusOr<Roles> RolesFromNames(std::string_view names) {
  Roles roles;
  for (std::size_t first = 0; first <= names.size();) {
    const std::size_t comma = std::min(names.find(',', first), names.size());
    ASSIGN_OR_RETURN(const Role role, RoleFromName(names.substr(first, comma - first)));
    roles.Add(role);
    first = comma + 1;
  }
  return roles;
}

std::optional<Access> AccessTo(std::string_view method) {
  const auto entry = Table().find(method);
  if (entry == Table().end()) return std::nullopt;
  return entry->second;
}

}  // namespace vorocast::rpc
