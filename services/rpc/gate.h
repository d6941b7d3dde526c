// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "services/base/status.h"
#include "services/rpc/roles.h"
#include "services/rpc/tokens.h"

namespace grpc {
class ServerContextBase;
}

namespace vorocast::rpc {

/// Who calls.
struct Caller {
  bool known = false;  // has shown a token; otherwise nobody was asked for one, and everything is allowed
  std::string name;    // the token's
  Roles roles;

  /// Whether this caller may change what `owner` submitted.
  bool MayChange(std::string_view owner) const { return !known || roles.Has(Role::kOperate) || name == owner; }
};

/// So many at once, and so many a second after that.
class RateLimit {
 public:
  RateLimit(double per_second, double burst) : per_second_(per_second), burst_(burst), left_(burst) {}
  bool Take(absl::Time now);

 private:
  double per_second_, burst_, left_;
  absl::Time last_ = absl::InfinitePast();
};

/// Lets a call pass or not: by the token it carries, and by the method (roles.h). Every call of every service of a server passes it, before
/// anything else is done for it (server.h). Used from any thread.
class Gate {
 public:
  struct Options {
    std::filesystem::path tokens;  // read again when it changes, so that a token can be withdrawn
    double requests_per_second = 1000;
    double requests_burst = 5000;
    absl::Duration look_interval = absl::Seconds(1);  // at the file
    std::function<absl::Time()> clock = [] { return absl::Now(); };
    std::function<void(const std::string&)> log;  // of refusals, a bounded number a second; not told: nowhere
  };
  /// INVALID_ARGUMENT or NOT_FOUND when the file cannot be read.
  static absl::StatusOr<std::shared_ptr<Gate>> Open(Options options);

  /// UNAUTHENTICATED without a token that is on file, PERMISSION_DENIED when its roles do not reach, RESOURCE_EXHAUSTED when it calls too often.
  /// `authorization` is the call's metadata of this name, `peer` what is known of who calls, for the log.
  absl::Status Admit(std::string_view method, std::string_view authorization, const std::string& peer);
  /// Whose token it is, now.
  absl::StatusOr<Caller> Identify(std::string_view authorization);

 private:
  explicit Gate(Options options) : options_(std::move(options)) {}
  absl::Status Judge(std::string_view method, std::string_view authorization);
  absl::StatusOr<Caller> Find(std::string_view authorization);
  void LookAtFile();
  void Log(const std::string& text);

  const Options options_;
  std::mutex mutex_;
  // All guarded by mutex_:
  std::vector<TokenEntry> entries_;
  absl::Time looked_ = absl::InfinitePast();
  std::string stamp_;  // of the file that was read last
  std::map<std::string, RateLimit, std::less<>> rates_;
  RateLimit log_rate_{1, 20};
  std::int64_t not_logged_ = 0;
};

/// Who makes this call: for a method that treats its callers differently. Without a gate, or through a server's private door, not known.
absl::StatusOr<Caller> CallerOf(const grpc::ServerContextBase& context, Gate* gate);

/// The "authorization" that a token is sent as.
std::string Authorization(const std::string& token);

}  // namespace vorocast::rpc
