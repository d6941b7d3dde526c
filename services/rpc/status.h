// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string_view>

#include <grpcpp/support/status.h>

#include "services/base/digest.h"
#include "services/base/status.h"

namespace vorocast::rpc {

/// The codes of both are the same numbers; the message is kept.
absl::Status FromGrpc(const grpc::Status& status);
grpc::Status ToGrpc(const absl::Status& status);

/// A digest that came over the wire. INVALID_ARGUMENT names the field: "sha256: a digest has 64 hexadecimal digits, not 3".
absl::StatusOr<base::Digest> ParseDigest(std::string_view hex, std::string_view field);

}  // namespace vorocast::rpc
