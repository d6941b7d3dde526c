// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/remote_artifacts.h"

#include <poll.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <utility>

#include <fmt/format.h>

#include "absl/time/clock.h"
#include "services/rpc/channel.h"
#include "services/rpc/limits.h"
#include "services/rpc/status.h"

namespace vorocast::lease {
namespace {

namespace fs = std::filesystem;

/// Of one transfer over a slow network.
constexpr auto kTransferDeadline = std::chrono::minutes(30);
constexpr absl::Duration kPauseFirst = absl::Milliseconds(100);
constexpr absl::Duration kPauseLast = absl::Seconds(2);
/// So many times bytes may arrive with another digest before they are believed to be wrong where they come from.
constexpr int kDamagedMax = 3;

absl::Status Stopped() { return absl::CancelledError("stopped while files were on their way"); }

/// Whether the same call may succeed later.
bool IsPassing(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status) || absl::IsResourceExhausted(status) || absl::IsDataLoss(status) ||
         absl::IsUnauthenticated(status) || absl::IsAborted(status) || absl::IsCancelled(status);
}

/// Sooner when stopped.
void Wait(const StopFlag& stop, absl::Duration duration) {
  pollfd polled{stop.fd(), POLLIN, 0};
  (void)::poll(&polled, 1, static_cast<int>(absl::ToInt64Milliseconds(duration)));
}

absl::Status CacheProblem(const fs::path& file, std::string_view what) {
  return absl::UnavailableError(fmt::format("{}: {}; check that the cache folder's disk is writable and not full", file.string(), what));
}

/// Removes the file unless it has been published.
struct Temporary {
  fs::path path;
  ~Temporary() {
    std::error_code ignored;
    fs::remove(path, ignored);
  }
};

}  // namespace

absl::StatusOr<std::unique_ptr<RemoteArtifacts>> RemoteArtifacts::Open(const RemoteArtifactsOptions& options) {
  ASSIGN_OR_RETURN(ArtifactCache cache, ArtifactCache::Open(options.cache, options.cache_limit));
  std::unique_ptr<RemoteArtifacts> remote(new RemoteArtifacts(options, std::move(cache)));
  for (const std::string& address : rpc::SplitAddresses(options.scheduler)) {
    ASSIGN_OR_RETURN(const std::shared_ptr<grpc::Channel> channel, rpc::Connect(address, options.security));
    remote->schedulers_.push_back(v1::Artifacts::NewStub(channel));
  }
  return remote;
}

fs::path RemoteArtifacts::PathOf(const v1::ArtifactName& name) const {
  // Names come from tasks::TaskSpec, which has checked them.
  const base::Digest digest = *base::Digest::FromHex(name.digest());
  return name.kind() == v1::ArtifactName::BLOB ? store().BlobPath(digest, name.extension()) : store().ArtifactPath(digest, name.extension());
}

absl::Status RemoteArtifacts::Retry(const StopFlag& stop, const std::function<absl::Status(v1::Artifacts::Stub&)>& call) {
  const absl::Time give_up = absl::Now() + options_.patience;
  absl::Duration pause = kPauseFirst;
  int damaged = 0;
  for (std::size_t scheduler = 0;; scheduler = (scheduler + 1) % schedulers_.size()) {
    absl::Status status = call(*schedulers_[scheduler]);
    if (stop.stopped()) return Stopped();
    if (status.ok() || !IsPassing(status) || absl::Now() > give_up) return status;
    if (absl::IsDataLoss(status) && ++damaged >= kDamagedMax) return status;
    Wait(stop, pause);
    if (stop.stopped()) return Stopped();
    pause = std::min(2 * pause, kPauseLast);
  }
}

absl::StatusOr<std::vector<ArtifactCache::Hold>> RemoteArtifacts::Bring(const tasks::TaskSpec& spec, const StopFlag& stop) {
  std::vector<ArtifactCache::Hold> holds;
  for (const tasks::Input& input : spec.inputs) {
    if (!input.digest) continue;
    v1::ArtifactName name;
    name.set_kind(input.source == tasks::Input::Source::kBlob ? v1::ArtifactName::BLOB : v1::ArtifactName::RESULT);
    name.set_digest(input.digest->Hex());
    name.set_extension(input.extension);
    auto hold = BringOne(name, stop);
    if (!hold.ok()) return base::Annotate(hold.status(), fmt::format("input {} {}{}", input.role, input.digest->Short(), input.extension));
    holds.push_back(*std::move(hold));
  }
  return holds;
}

absl::StatusOr<ArtifactCache::Hold> RemoteArtifacts::BringOne(const v1::ArtifactName& name, const StopFlag& stop) {
  const fs::path path = PathOf(name);
  {
    std::unique_lock lock(mutex_);
    for (;;) {
      if (auto hold = cache_.HoldIfThere(path)) return *std::move(hold);
      if (coming_.insert(path).second) break;
      arrived_.wait_for(lock, std::chrono::milliseconds(200));
      if (stop.stopped()) return Stopped();
    }
  }
  absl::StatusOr<ArtifactCache::Hold> hold = absl::UnknownError("");
  const absl::Status status = Retry(stop, [&](v1::Artifacts::Stub& scheduler) {
    hold = GetOnce(scheduler, name, stop);
    return hold.status();
  });
  {
    const std::lock_guard lock(mutex_);
    coming_.erase(path);
  }
  arrived_.notify_all();
  if (!status.ok()) return status;
  return hold;
}

absl::StatusOr<ArtifactCache::Hold> RemoteArtifacts::GetOnce(v1::Artifacts::Stub& scheduler, const v1::ArtifactName& name, const StopFlag& stop) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kTransferDeadline);
  v1::GetArtifactRequest request;
  *request.mutable_name() = name;
  const auto reader = scheduler.Get(&context, request);

  const Temporary temporary{store().TemporaryPath(name.extension())};
  std::ofstream file(temporary.path, std::ios::binary);
  base::Hasher hasher;
  std::string sha256 = name.kind() == v1::ArtifactName::BLOB ? name.digest() : "";
  std::int64_t size = -1;
  std::int64_t arrived = 0;
  v1::ArtifactChunk chunk;
  while (reader->Read(&chunk)) {
    if (size < 0) {
      size = chunk.size();
      if (!chunk.sha256().empty() && sha256.empty()) sha256 = chunk.sha256();
      cache_.MakeRoom(size);
    }
    arrived += static_cast<std::int64_t>(chunk.data().size());
    if (arrived > size) context.TryCancel();
    hasher.Update(chunk.data());
    file.write(chunk.data().data(), static_cast<std::streamsize>(chunk.data().size()));
    if (!file || stop.stopped()) context.TryCancel();
  }
  const absl::Status status = rpc::FromGrpc(reader->Finish());
  file.close();
  if (!file) return CacheProblem(temporary.path, "cannot be written");
  if (size >= 0 && arrived > size) return absl::DataLossError(fmt::format("more than the {} bytes announced arrived", size));
  if (!status.ok()) return status;
  if (arrived != size) return absl::DataLossError(fmt::format("{} of {} bytes arrived", arrived, size));
  const std::string actual = hasher.Finish().Hex();
  if (!sha256.empty() && actual != sha256) return absl::DataLossError(fmt::format("the bytes that arrived have digest {}, not {}", actual, sha256));

  // Held before it has its name, so that it cannot go in between.
  auto hold = cache_.HoldIfThere(temporary.path);
  if (!hold) return CacheProblem(temporary.path, "cannot be read");
  const base::Digest digest = *base::Digest::FromHex(name.digest());
  RETURN_IF_ERROR(name.kind() == v1::ArtifactName::BLOB ? store().PublishBlob(temporary.path, digest, name.extension())
                                                        : store().PublishArtifact(temporary.path, digest, name.extension()));
  // Another process of this machine may have been first; then its file is the one to hold.
  if (auto published = cache_.HoldIfThere(PathOf(name))) return *std::move(published);
  return CacheProblem(PathOf(name), "is gone");
}

absl::Status RemoteArtifacts::Deliver(const base::Digest& key, std::string_view extension, const StopFlag& stop) {
  v1::PutArtifactChunk first;
  v1::ArtifactName& name = *first.mutable_name();
  name.set_kind(v1::ArtifactName::RESULT);
  name.set_digest(key.Hex());
  name.set_extension(std::string(extension));
  const fs::path path = PathOf(name);
  cache_.MakeRoom(0);
  const auto hold = cache_.HoldIfThere(path);
  if (!hold) return CacheProblem(path, "is gone");
  ASSIGN_OR_RETURN(const base::Digest digest, base::HashFile(path));
  std::error_code error;
  first.set_size(static_cast<std::int64_t>(fs::file_size(path, error)));
  if (error) return CacheProblem(path, error.message());
  first.set_sha256(digest.Hex());
  const absl::Status status = Retry(stop, [&](v1::Artifacts::Stub& scheduler) { return PutOnce(scheduler, first, path, stop); });
  if (!absl::IsAlreadyExists(status)) return status;
  fs::remove(path, error);
  return BringOne(name, stop).status();
}

absl::Status RemoteArtifacts::PutOnce(v1::Artifacts::Stub& scheduler, const v1::PutArtifactChunk& first, const fs::path& path, const StopFlag& stop) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return CacheProblem(path, "cannot be read");
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kTransferDeadline);
  v1::PutArtifactReply reply;
  const auto writer = scheduler.Put(&context, &reply);
  bool open = writer->Write(first);
  v1::PutArtifactChunk chunk;
  std::string block(rpc::kChunkBytesMax, '\0');
  while (open && file && !stop.stopped()) {
    file.read(block.data(), static_cast<std::streamsize>(block.size()));
    if (file.gcount() == 0) break;
    chunk.set_data(block.data(), static_cast<std::size_t>(file.gcount()));
    open = writer->Write(chunk);
  }
  if (stop.stopped()) context.TryCancel();
  writer->WritesDone();
  return rpc::FromGrpc(writer->Finish());
}

}  // namespace vorocast::lease
