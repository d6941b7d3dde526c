// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/artifacts_service.h"

#include <algorithm>

#include <fmt/format.h>

#include "scheduler/server/fetch_call.h"
#include "scheduler/server/put_call.h"
#include "services/rpc/status.h"
#include "services/tasks/task.h"

namespace vorocast::server {
namespace {

constexpr std::string_view kBlobExtensions[] = {".ply", ".obj", ".off", ".drc"};

struct CheckedName {
  v1::ArtifactName::Kind kind;
  base::Digest digest;
  std::string extension;
};

/// Only what has passed here becomes part of a path.
absl::StatusOr<CheckedName> Check(const v1::ArtifactName& name) {
  ASSIGN_OR_RETURN(const base::Digest digest, rpc::ParseDigest(name.digest(), "name.digest"));
  const auto is_extension = [&](std::string_view known) { return known == name.extension(); };
  bool known = false;
  if (name.kind() == v1::ArtifactName::BLOB) {
    known = std::any_of(std::begin(kBlobExtensions), std::end(kBlobExtensions), is_extension);
  } else if (name.kind() == v1::ArtifactName::RESULT) {
    known =
        std::any_of(std::begin(tasks::kAllKinds), std::end(tasks::kAllKinds), [&](tasks::Kind kind) { return is_extension(tasks::Extension(kind)); });
  } else {
    return absl::InvalidArgumentError("name.kind must be BLOB or RESULT");
  }
  if (!known) return absl::InvalidArgumentError("name.extension is none of those that a blob or a result of that kind can have");
  return CheckedName{name.kind(), digest, name.extension()};
}

}  // namespace

grpc::ServerWriteReactor<v1::ArtifactChunk>* ArtifactsService::Get(grpc::CallbackServerContext*, const v1::GetArtifactRequest* request) {
  auto* call = new FileCall<v1::ArtifactChunk>(disk_);
  auto name = Check(request->name());
  if (!name.ok()) {
    call->Refuse(name.status());
    return call;
  }
  disk_.Run([this, call, name = *std::move(name)] {
    const bool blob = name.kind == v1::ArtifactName::BLOB;
    if (!(blob ? artifacts_.HasBlob(name.digest, name.extension) : artifacts_.HasArtifact(name.digest, name.extension))) {
      return call->Refuse(absl::NotFoundError(fmt::format("there is no {} {}{}", blob ? "blob" : "result", name.digest.Hex(), name.extension)));
    }
    if (blob) return call->Send(artifacts_.BlobPath(name.digest, name.extension), name.digest.Hex());
    const auto on_record = store_.FindResult(name.digest);
    if (!on_record.ok()) return call->Refuse(on_record.status());
    call->Send(artifacts_.ArtifactPath(name.digest, name.extension), *on_record ? (*on_record)->sha256.Hex() : "");
  });
  return call;
}

grpc::ServerReadReactor<v1::PutArtifactChunk>* ArtifactsService::Put(grpc::CallbackServerContext*, v1::PutArtifactReply*) {
  return new PutCall(engine_, artifacts_, disk_);
}

}  // namespace vorocast::server
