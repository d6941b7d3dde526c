// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/server/captures_service.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "absl/time/clock.h"
#include "scheduler/server/unary_call.h"
#include "scheduler/server/upload_call.h"
#include "services/storage/collection.h"

namespace vorocast::server {
namespace {

constexpr int kPortionMax = 10'000;
constexpr std::int32_t kFrameNumberMax = 10'000'000;
constexpr std::size_t kNameMax = 200;

absl::Status CheckName(const std::string& name, std::string_view field) {
  const bool has_control = std::any_of(name.begin(), name.end(), [](char c) { return static_cast<unsigned char>(c) < 32 || c == 127; });
  if (name.empty() || name.size() > kNameMax || has_control) {
    return absl::InvalidArgumentError(fmt::format("{} must have 1 to {} characters and no control characters", field, kNameMax));
  }
  return absl::OkStatus();
}

absl::Status CheckNumber(double value, double low, double high, std::string_view field) {
  if (std::isfinite(value) && value >= low && value <= high) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format("{} is {}; it must be from {} to {}", field, value, low, high));
}

absl::StatusOr<store::SequenceOpened> Asked(const v1::OpenSequenceRequest& request) {
  RETURN_IF_ERROR(CheckName(request.session(), "session"));
  RETURN_IF_ERROR(CheckName(request.name(), "name"));
  RETURN_IF_ERROR(CheckNumber(request.frames_per_second(), 1, 1000, "frames_per_second"));
  RETURN_IF_ERROR(CheckNumber(request.metres_per_unit(), 1e-6, 1e3, "metres_per_unit"));
  constexpr std::array<std::string_view, 6> kAxes = {"+x", "-x", "+y", "-y", "+z", "-z"};
  if (std::find(kAxes.begin(), kAxes.end(), request.up()) == kAxes.end()) {
    return absl::InvalidArgumentError("up is unknown; it must be one of +x, -x, +y, -y, +z, -z");
  }
  return store::SequenceOpened{.session = request.session(),
                               .name = request.name(),
                               .frames_per_second = request.frames_per_second(),
                               .metres_per_unit = request.metres_per_unit(),
                               .up = request.up()};
}

absl::StatusOr<std::vector<store::FrameAdded>> AskedFrames(const v1::AddFramesRequest& request, const storage::ArtifactStore& artifacts) {
  if (request.frames_size() > kPortionMax) return absl::InvalidArgumentError(fmt::format("frames: at most {} at once", kPortionMax));
  std::vector<store::FrameAdded> frames;
  for (const v1::Frame& frame : request.frames()) {
    if (frame.number() < 0 || frame.number() > kFrameNumberMax) {
      return absl::InvalidArgumentError(fmt::format("frame number {}: it must be from 0 to {}", frame.number(), kFrameNumberMax));
    }
    auto digest = CheckBlob(frame.blob());
    if (!digest.ok()) return base::Annotate(digest.status(), fmt::format("frame {}", frame.number()));
    storage::NoteUse(artifacts.BlobPath(*digest, frame.blob().extension()), absl::Now());
    std::error_code error;
    const auto size = std::filesystem::file_size(artifacts.BlobPath(*digest, frame.blob().extension()), error);
    if (error)
      return absl::FailedPreconditionError(
          fmt::format("frame {}: its blob {} is not in the store; upload it first", frame.number(), digest->Short()));
    frames.push_back({.number = frame.number(), .blob = *digest, .extension = frame.blob().extension(), .size = static_cast<std::int64_t>(size)});
  }
  return frames;
}

absl::Status Fill(const absl::StatusOr<const CatalogueSequence*>& sequence, v1::Sequence& reply) {
  RETURN_IF_ERROR(sequence.status());
  const store::SequenceOpened& opened = (*sequence)->opened;
  reply.set_id(opened.id);
  reply.set_session(opened.session);
  reply.set_name(opened.name);
  reply.set_frames_per_second(opened.frames_per_second);
  reply.set_metres_per_unit(opened.metres_per_unit);
  reply.set_up(opened.up);
  reply.set_frame_count(static_cast<std::int32_t>((*sequence)->frame_count));
  reply.set_closed((*sequence)->closed);
  return absl::OkStatus();
}

}  // namespace

grpc::ServerUnaryReactor* CapturesService::Open(grpc::CallbackServerContext* context, const v1::OpenSequenceRequest* request, v1::Sequence* reply) {
  auto asked = Asked(*request);
  if (!asked.ok()) return Answer(context, asked.status());
  return AnswerInTurn<v1::Sequence>(context, engine_, reply, [this, asked = *std::move(asked)](Turn& turn, v1::Sequence& sequence) {
    return Fill(catalogue_.Open(turn, asked), sequence);
  });
}

grpc::ServerUnaryReactor* CapturesService::Missing(grpc::CallbackServerContext* context, const v1::MissingRequest* request, v1::MissingReply* reply) {
  if (request->blobs_size() > kPortionMax) return Answer(context, absl::InvalidArgumentError(fmt::format("blobs: at most {} at once", kPortionMax)));
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  disk_.Run([this, request, reply, reactor] {
    for (const v1::Blob& blob : request->blobs()) {
      const auto digest = CheckBlob(blob);
      if (!digest.ok()) return reactor->Finish(rpc::ToGrpc(digest.status()));
      storage::NoteUse(artifacts_.BlobPath(*digest, blob.extension()), absl::Now());
      if (!artifacts_.HasBlob(*digest, blob.extension())) *reply->add_blobs() = blob;
    }
    reactor->Finish(grpc::Status::OK);
  });
  return reactor;
}

grpc::ServerReadReactor<v1::UploadChunk>* CapturesService::Upload(grpc::CallbackServerContext*, v1::UploadReply*) {
  return new UploadCall(artifacts_, disk_, metrics_);
}

grpc::ServerUnaryReactor* CapturesService::Add(grpc::CallbackServerContext* context, const v1::AddFramesRequest* request, v1::Sequence* reply) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  disk_.Run([this, request, reply, reactor] {
    auto frames = AskedFrames(*request, artifacts_);
    if (!frames.ok()) return reactor->Finish(rpc::ToGrpc(frames.status()));
    FinishInTurn<v1::Sequence>(reactor, engine_, reply, [this, request, frames = *std::move(frames)](Turn& turn, v1::Sequence& sequence) {
      return Fill(catalogue_.Add(turn, request->sequence_id(), frames), sequence);
    });
  });
  return reactor;
}

grpc::ServerUnaryReactor* CapturesService::Close(grpc::CallbackServerContext* context, const v1::CloseSequenceRequest* request, v1::Sequence* reply) {
  return AnswerInTurn<v1::Sequence>(context, engine_, reply, [this, request](Turn& turn, v1::Sequence& sequence) {
    return Fill(catalogue_.Close(turn, request->sequence_id()), sequence);
  });
}

}  // namespace vorocast::server
