// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rpc/gate.h"

#include <sys/stat.h>

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <grpcpp/server_context.h>

namespace vorocast::rpc {
namespace {

constexpr std::string_view kScheme = "Bearer ";

/// Differs when the file has been changed or replaced.
std::string StampOf(const std::filesystem::path& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) return "";
  return fmt::format("{} {} {} {}.{}", info.st_dev, info.st_ino, info.st_size, info.st_mtim.tv_sec, info.st_mtim.tv_nsec);
}

/// A method comes from outside and goes into a log line.
std::string Printable(std::string_view text) {
  std::string printable(text.substr(0, 200));
  std::replace_if(
      printable.begin(), printable.end(), [](unsigned char c) { return c < 32 || c > 126 || c == '"'; }, '?');
  return printable;
}

}  // namespace

bool RateLimit::Take(absl::Time now) {
  if (last_ != absl::InfinitePast()) left_ = std::min(burst_, left_ + per_second_ * std::max(0.0, absl::ToDoubleSeconds(now - last_)));
  last_ = now;
  if (left_ < 1) return false;
  left_ -= 1;
  return true;
}

absl::StatusOr<std::shared_ptr<Gate>> Gate::Open(Options options) {
  std::shared_ptr<Gate> gate(new Gate(std::move(options)));
  gate->stamp_ = StampOf(gate->options_.tokens);
  ASSIGN_OR_RETURN(gate->entries_, ReadTokens(gate->options_.tokens));
  gate->looked_ = gate->options_.clock();
  return gate;
}

/// A file that cannot be read or understood leaves nobody in: a withdrawn token must not live on because of a slip elsewhere in the file.
void Gate::LookAtFile() {
  const absl::Time now = options_.clock();
  if (now - looked_ < options_.look_interval && now >= looked_) return;
  looked_ = now;
  std::string stamp = StampOf(options_.tokens);
  if (stamp == stamp_) return;
  stamp_ = std::move(stamp);
  auto entries = ReadTokens(options_.tokens);
  if (entries.ok()) {
    entries_ = *std::move(entries);
    if (options_.log) options_.log(fmt::format("tokens read again: file={} tokens={}", options_.tokens.string(), entries_.size()));
    return;
  }
  entries_.clear();
  if (options_.log) {
    options_.log(fmt::format("tokens cannot be read, nobody is let in until they can: error=\"{}\"", std::string(entries.status().message())));
  }
}

absl::StatusOr<Caller> Gate::Find(std::string_view authorization) {
  LookAtFile();
  if (authorization.empty()) return absl::UnauthenticatedError("this service asks for a token; give one with --token-file");
  if (!authorization.starts_with(kScheme) || authorization.size() > kScheme.size() + kTokenBytesMax) {
    return absl::UnauthenticatedError("the call's authorization is not a bearer token");
  }
  const TokenEntry* entry = FindToken(entries_, authorization.substr(kScheme.size()));
  if (!entry) return absl::UnauthenticatedError("the token is unknown, or has been withdrawn");
  return Caller{.known = true, .name = entry->name, .roles = entry->roles};
}

absl::StatusOr<Caller> Gate::Identify(std::string_view authorization) {
  const std::lock_guard lock(mutex_);
  return Find(authorization);
}

absl::Status Gate::Judge(std::string_view method, std::string_view authorization) {
  const std::optional<Access> access = AccessTo(method);
  if (access && access->anybody) return absl::OkStatus();
  ASSIGN_OR_RETURN(const Caller caller, Find(authorization));
  if (!access) return absl::PermissionDeniedError(fmt::format("{} is not a method that anybody may call", Printable(method)));
  if (!caller.roles.Has(access->least)) {
    return absl::PermissionDeniedError(
        fmt::format("{} needs the role {}; the token of {} has {}", Printable(method), Name(access->least), caller.name, caller.roles.Names()));
  }
  auto rate = rates_.find(caller.name);
  if (rate == rates_.end()) {
    // Names are those of a file of bounded length; what is no longer in it need not be remembered.
    if (rates_.size() >= 2 * kTokenEntriesMax) rates_.clear();
    rate = rates_.emplace(caller.name, RateLimit(options_.requests_per_second, options_.requests_burst)).first;
  }
  if (!rate->second.Take(options_.clock())) {
    return absl::ResourceExhaustedError(
        fmt::format("{} calls more than {} times a second; wait and try again", caller.name, options_.requests_per_second));
  }
  return absl::OkStatus();
}

absl::Status Gate::Admit(std::string_view method, std::string_view authorization, const std::string& peer) {
  const std::lock_guard lock(mutex_);
  absl::Status status = Judge(method, authorization);
  if (!status.ok()) {
    Log(fmt::format("refused: method=\"{}\" peer=\"{}\" reason=\"{}\"", Printable(method), Printable(peer), std::string(status.message())));
  }
  return status;
}

void Gate::Log(const std::string& text) {
  if (!options_.log) return;
  if (!log_rate_.Take(options_.clock())) {
    ++not_logged_;
    return;
  }
  const std::int64_t more = std::exchange(not_logged_, 0);
  options_.log(more == 0 ? text : fmt::format("{} (and {} before it that were not logged)", text, more));
}

absl::StatusOr<Caller> CallerOf(const grpc::ServerContextBase& context, Gate* gate) {
  if (!gate) return Caller{};
  const auto& metadata = context.client_metadata();
  const auto authorization = metadata.find("authorization");
  const auto auth = context.auth_context();
  const auto kinds = auth ? auth->FindPropertyValues("transport_security_type") : std::vector<grpc::string_ref>();
  const bool guarded = std::any_of(kinds.begin(), kinds.end(), [](const grpc::string_ref& kind) { return kind != "insecure"; });
  // The private door is a socket in a folder that nobody else can enter; what a stranger reaches is never a Unix socket without a guard.
  if (!guarded && context.peer().starts_with("unix:")) return Caller{};
  if (authorization == metadata.end()) return gate->Identify("");
  return gate->Identify({authorization->second.data(), authorization->second.size()});
}

std::string Authorization(const std::string& token) { return std::string(kScheme) + token; }

}  // namespace vorocast::rpc
