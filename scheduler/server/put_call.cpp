// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/put_call.h"

#include <utility>
#include <variant>

#include <fmt/format.h>

#include "scheduler/core/state.h"
#include "services/rpc/status.h"
#include "services/tasks/task.h"

namespace vorocast::server {
namespace {

constexpr std::int64_t kResultBytesMax = std::int64_t{64} << 30;

/// FAILED_PRECONDITION unless somebody holds a lease of a task with this key and that kind of file.
absl::Status CheckLeased(const core::State& state, const base::Digest& key, const std::string& extension) {
  const auto found = state.run_by_key.find(key);
  const core::Run* run = found == state.run_by_key.end() ? nullptr : &state.runs[found->second];
  if (!run || !std::holds_alternative<core::Leased>(run->state)) {
    return absl::FailedPreconditionError(fmt::format("result {}: no leased task has this key; its lease may have run out", key.Short()));
  }
  if (tasks::Extension(run->kind) == extension) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format("name.extension: the task's result is a {} file", tasks::Extension(run->kind)));
}

}  // namespace

PutCall::PutCall(Engine& engine, const storage::ArtifactStore& artifacts, DiskThreads& disk) : engine_(engine), artifacts_(artifacts), disk_(disk) {
  StartRead(&chunk_);
}

void PutCall::OnReadDone(bool ok) {
  disk_.Run([this, ok] { Take(ok); });
}

void PutCall::End(const absl::Status& status) { Finish(rpc::ToGrpc(status)); }

void PutCall::Take(bool ok) {
  if (!ok) return End(Publish());
  if (size_ < 0) {
    if (const absl::Status status = ReadName(); !status.ok()) return End(status);
    return AskWhetherLeased();
  }
  if (chunk_.has_name()) return End(absl::InvalidArgumentError("only the first message names the result"));
  if (const absl::Status status = file_.Write(chunk_.data()); !status.ok()) return End(status);
  StartRead(&chunk_);
}

absl::Status PutCall::ReadName() {
  const v1::ArtifactName& name = chunk_.name();
  if (name.kind() != v1::ArtifactName::RESULT) return absl::InvalidArgumentError("name.kind must be RESULT: the first message names what is put");
  ASSIGN_OR_RETURN(key_, rpc::ParseDigest(name.digest(), "name.digest"));
  ASSIGN_OR_RETURN(sha256_, rpc::ParseDigest(chunk_.sha256(), "sha256"));
  if (chunk_.size() < 0 || chunk_.size() > kResultBytesMax) {
    return absl::InvalidArgumentError(fmt::format("size is {}; a result has at most {} bytes", chunk_.size(), kResultBytesMax));
  }
  // Becomes part of a path only after it has been found equal to one of the extensions that results have.
  extension_ = name.extension();
  size_ = chunk_.size();
  return absl::OkStatus();
}

void PutCall::AskWhetherLeased() {
  const absl::Status accepted = engine_.Ask([this](Turn& turn) {
    absl::Status leased = CheckLeased(turn.state(), key_, extension_);
    turn.Answer([this, leased = std::move(leased)](const absl::Status& durable) {
      if (!leased.ok() || !durable.ok()) return End(leased.ok() ? durable : leased);
      disk_.Run([this] { Begin(); });
    });
  });
  if (!accepted.ok()) End(accepted);
}

void PutCall::Begin() {
  if (artifacts_.HasArtifact(key_, extension_)) {
    const auto there = base::HashFile(artifacts_.ArtifactPath(key_, extension_));
    if (!there.ok()) return End(absl::UnavailableError(std::string(there.status().message())));
    if (*there == sha256_) return End(absl::OkStatus());
    return End(absl::AlreadyExistsError(fmt::format("result {} is there already, with other bytes; the first stays", key_.Short())));
  }
  absl::Status status = file_.Begin(artifacts_.TemporaryPath(extension_), size_, fmt::format("result {}", key_.Short()));
  if (status.ok()) status = file_.Write(chunk_.data());
  if (!status.ok()) return End(status);
  StartRead(&chunk_);
}

absl::Status PutCall::Publish() {
  if (!file_.begun()) return absl::InvalidArgumentError("the first message must name the result");
  ASSIGN_OR_RETURN(const base::Digest arrived, file_.End());
  if (arrived != sha256_) {
    return absl::DataLossError(fmt::format("result {}: the bytes have digest {}, not {}; send it again", key_.Short(), arrived.Hex(), sha256_.Hex()));
  }
  return artifacts_.PublishArtifact(file_.path(), key_, extension_);
}

}  // namespace vorocast::server
