// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rpc/status.h"

#include <string>

namespace vorocast::rpc {

absl::Status FromGrpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  return absl::Status(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
}

grpc::Status ToGrpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  return grpc::Status(static_cast<grpc::StatusCode>(status.code()), std::string(status.message()));
}

absl::StatusOr<base::Digest> ParseDigest(std::string_view hex, std::string_view field) {
  auto digest = base::Digest::FromHex(hex);
  if (!digest.ok()) return base::Annotate(digest.status(), field);
  return digest;
}

}  // namespace vorocast::rpc
