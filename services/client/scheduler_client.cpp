// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/scheduler_client.h"

#include <algorithm>
#include <chrono>
#include <fstream>
#include <set>
#include <stop_token>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <grpcpp/grpcpp.h>

#include "services/base/digest.h"
#include "services/rpc/channel.h"
#include "services/rpc/status.h"

namespace vorocast::client {
namespace {

constexpr auto kCallDeadline = std::chrono::seconds(60);
constexpr auto kCallDeadlineOfSeveral = std::chrono::seconds(20);
/// So long no scheduler of several may lead before a call gives up.
constexpr auto kTakeoverTime = std::chrono::seconds(60);
constexpr auto kUploadDeadline = std::chrono::minutes(30);  // of one frame, over a slow network
constexpr auto kInterruptInterval = std::chrono::milliseconds(100);
constexpr std::size_t kChunkBytes = 1 << 20;
constexpr std::size_t kFramesPerCall = 1000;

std::string LowerCaseExtension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

absl::StatusOr<v1::Blob> BlobOf(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const base::Digest digest, base::HashFile(path));
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  if (error) return absl::NotFoundError(fmt::format("{}: {}", path.string(), error.message()));
  v1::Blob blob;
  blob.set_sha256(digest.Hex());
  blob.set_extension(LowerCaseExtension(path));
  blob.set_size(static_cast<std::int64_t>(size));
  return blob;
}

/// Sends one blob's bytes.
absl::Status UploadOnce(v1::Captures::Stub& captures, const v1::Blob& blob, const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::NotFoundError(fmt::format("{}: cannot be opened", path.string()));
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kUploadDeadline);
  v1::UploadReply reply;
  const auto writer = captures.Upload(&context, &reply);
  v1::UploadChunk chunk;
  *chunk.mutable_blob() = blob;
  bool open = writer->Write(chunk);
  chunk.clear_blob();
  std::string block(kChunkBytes, '\0');
  while (open && file) {
    file.read(block.data(), static_cast<std::streamsize>(block.size()));
    if (file.gcount() == 0) break;
    chunk.set_data(block.data(), static_cast<std::size_t>(file.gcount()));
    open = writer->Write(chunk);
  }
  writer->WritesDone();
  return base::Annotate(rpc::FromGrpc(writer->Finish()), path.string());
}

}  // namespace

SchedulerClient::SchedulerClient(const std::string& address) : SchedulerClient(*Open(address, {})) {}

absl::StatusOr<SchedulerClient> SchedulerClient::Open(const std::string& address, const rpc::ClientSecurity& security) {
  SchedulerClient client;
  client.address_ = address;
  for (const std::string& each : rpc::SplitAddresses(address)) {
    ASSIGN_OR_RETURN(const std::shared_ptr<grpc::Channel> channel, rpc::Connect(each, security));
    client.schedulers_.push_back({v1::Captures::NewStub(channel), v1::Jobs::NewStub(channel)});
  }
  return client;
}

absl::Status SchedulerClient::WithLeader(const std::function<absl::Status(const Scheduler&)>& call, const std::function<bool()>& interrupted) {
  const auto give_up = std::chrono::steady_clock::now() + kTakeoverTime;
  while (true) {
    const absl::Status status = call(schedulers_[in_use_]);
    if (schedulers_.size() == 1 || !(absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status))) return status;
    if (interrupted() || std::chrono::steady_clock::now() > give_up) return status;
    in_use_ = (in_use_ + 1) % schedulers_.size();
    std::this_thread::sleep_for(kInterruptInterval);
  }
}

/// One unary call with a deadline; the gRPC status becomes an absl one.
template <typename Service, typename Request, typename Reply>
absl::StatusOr<Reply> SchedulerClient::Call(std::unique_ptr<Service> Scheduler::*service,
                                            grpc::Status (Service::*method)(grpc::ClientContext*, const Request&, Reply*), const Request& request) {
  Reply reply;
  // One that was stopped keeps its connections and answers nothing; where there is another, that is found out sooner.
  const auto deadline = schedulers_.size() == 1 ? kCallDeadline : kCallDeadlineOfSeveral;
  RETURN_IF_ERROR(WithLeader([&](const Scheduler& scheduler) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + deadline);
    return rpc::FromGrpc(((*(scheduler.*service)).*method)(&context, request, &reply));
  }));
  return reply;
}

absl::StatusOr<v1::Sequence> SchedulerClient::Upload(const capture::Capture& capture, const std::string& session, const base::Progress& progress,
                                                     const std::function<bool()>& interrupted) {
  ASSIGN_OR_RETURN(const v1::Sequence sequence, OpenSequence(capture, session));
  RETURN_IF_ERROR(SendFrames(sequence.id(), capture.frames, progress, interrupted).status());
  return CloseSequence(sequence.id());
}

absl::StatusOr<v1::Sequence> SchedulerClient::OpenSequence(const capture::Capture& capture, const std::string& session) {
  v1::OpenSequenceRequest open;
  open.set_session(session);
  open.set_name(capture.name);
  open.set_frames_per_second(capture.frames_per_second);
  open.set_metres_per_unit(capture.metres_per_unit);
  open.set_up(capture.up);
  return Call(&Scheduler::captures, &v1::Captures::Stub::Open, open);
}

absl::StatusOr<v1::Sequence> SchedulerClient::SendFrames(const std::string& sequence_id, const std::vector<capture::CaptureFrame>& frames,
                                                         const base::Progress& progress, const std::function<bool()>& interrupted) {
  std::vector<v1::Blob> blobs;
  for (const capture::CaptureFrame& frame : frames) {
    if (interrupted()) return absl::CancelledError("stopped; the same command goes on from here");
    ASSIGN_OR_RETURN(blobs.emplace_back(), BlobOf(frame.path));
    base::Report(progress, 0.3 * static_cast<double>(blobs.size()) / static_cast<double>(frames.size()));
  }
  v1::Sequence sequence;
  for (std::size_t first = 0; first < blobs.size(); first += kFramesPerCall) {
    const std::size_t last = std::min(blobs.size(), first + kFramesPerCall);
    v1::MissingRequest ask;
    v1::AddFramesRequest add;
    add.set_sequence_id(sequence_id);
    for (std::size_t i = first; i < last; ++i) {
      *ask.add_blobs() = blobs[i];
      v1::Frame& frame = *add.add_frames();
      frame.set_number(frames[i].number);
      *frame.mutable_blob() = blobs[i];
    }
    ASSIGN_OR_RETURN(const v1::MissingReply missing, Call(&Scheduler::captures, &v1::Captures::Stub::Missing, ask));
    std::set<std::string> wanted;
    for (const v1::Blob& blob : missing.blobs()) wanted.insert(blob.sha256() + blob.extension());
    for (std::size_t i = first; i < last; ++i) {
      if (interrupted()) return absl::CancelledError("stopped; the same command goes on from here");
      if (wanted.erase(blobs[i].sha256() + blobs[i].extension()) > 0) RETURN_IF_ERROR(UploadBlob(blobs[i], frames[i].path));
      base::Report(progress, 0.3 + 0.7 * static_cast<double>(i + 1) / static_cast<double>(blobs.size()));
    }
    ASSIGN_OR_RETURN(sequence, Call(&Scheduler::captures, &v1::Captures::Stub::Add, add));
  }
  return sequence;
}

absl::StatusOr<v1::Sequence> SchedulerClient::CloseSequence(const std::string& sequence_id) {
  v1::CloseSequenceRequest close;
  close.set_sequence_id(sequence_id);
  return Call(&Scheduler::captures, &v1::Captures::Stub::Close, close);
}

absl::Status SchedulerClient::UploadBlob(const v1::Blob& blob, const std::filesystem::path& path) {
  return WithLeader([&](const Scheduler& scheduler) { return UploadOnce(*scheduler.captures, blob, path); });
}

absl::StatusOr<v1::Job> SchedulerClient::Submit(const v1::SubmitJobRequest& request) {
  return Call(&Scheduler::jobs, &v1::Jobs::Stub::Submit, request);
}

absl::StatusOr<v1::Job> SchedulerClient::Get(const std::string& job_id) {
  v1::JobRequest request;
  request.set_job_id(job_id);
  return Call(&Scheduler::jobs, &v1::Jobs::Stub::Get, request);
}

absl::StatusOr<std::vector<v1::Job>> SchedulerClient::List(std::int32_t limit) {
  v1::ListJobsRequest request;
  request.set_limit(limit);
  ASSIGN_OR_RETURN(const v1::ListJobsReply reply, Call(&Scheduler::jobs, &v1::Jobs::Stub::List, request));
  return std::vector<v1::Job>(reply.jobs().begin(), reply.jobs().end());
}

absl::StatusOr<v1::Job> SchedulerClient::Cancel(const std::string& job_id) {
  v1::JobRequest request;
  request.set_job_id(job_id);
  return Call(&Scheduler::jobs, &v1::Jobs::Stub::Cancel, request);
}

absl::StatusOr<v1::Job> SchedulerClient::Retry(const v1::RetryJobRequest& request) { return Call(&Scheduler::jobs, &v1::Jobs::Stub::Retry, request); }

absl::StatusOr<v1::Job> SchedulerClient::Pause(const std::string& job_id) {
  v1::JobRequest request;
  request.set_job_id(job_id);
  return Call(&Scheduler::jobs, &v1::Jobs::Stub::Pause, request);
}

absl::StatusOr<v1::Job> SchedulerClient::Resume(const std::string& job_id) {
  v1::JobRequest request;
  request.set_job_id(job_id);
  return Call(&Scheduler::jobs, &v1::Jobs::Stub::Resume, request);
}

absl::StatusOr<std::string> SchedulerClient::Explain(const std::string& job_id, const std::string& task) {
  v1::ExplainRequest request;
  request.set_job_id(job_id);
  request.set_task(task);
  ASSIGN_OR_RETURN(const v1::ExplainReply reply, Call(&Scheduler::jobs, &v1::Jobs::Stub::Explain, request));
  return reply.text();
}

absl::StatusOr<v1::Job> SchedulerClient::Watch(const std::string& job_id, const std::function<void(const v1::Job&)>& seen,
                                               const std::function<bool()>& interrupted) {
  v1::JobRequest request;
  request.set_job_id(job_id);
  v1::Job job;
  absl::Status status;
  bool heard = true;
  // Each scheduler that leads for a while begins the time anew.
  while (std::exchange(heard, false)) {
    status = WithLeader(
        [&](const Scheduler& scheduler) {
          grpc::ClientContext context;
          const auto reader = scheduler.jobs->Watch(&context, request);
          // Read blocks until the job changes, so another thread looks for the interruption.
          const std::jthread interrupter([&](const std::stop_token& stop) {
            while (!stop.stop_requested()) {
              if (interrupted()) context.TryCancel();
              std::this_thread::sleep_for(kInterruptInterval);
            }
          });
          while (reader->Read(&job)) {
            heard = true;
            seen(job);
          }
          return rpc::FromGrpc(reader->Finish());
        },
        interrupted);
    if (status.ok() || schedulers_.size() == 1 || interrupted()) break;
  }
  RETURN_IF_ERROR(status);
  return job;
}

absl::Status SchedulerClient::Fetch(const std::string& job_id, const v1::Output& output, const std::filesystem::path& path) {
  return WithLeader([&](const Scheduler&) { return FetchOnce(job_id, output, path); });
}

absl::Status SchedulerClient::FetchOnce(const std::string& job_id, const v1::Output& output, const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const base::Digest expected, base::Digest::FromHex(output.sha256()));
  std::error_code error;
  if (std::filesystem::file_size(path, error) == static_cast<std::uintmax_t>(output.size()) && !error) {
    if (auto present = base::HashFile(path); present.ok() && *present == expected) return absl::OkStatus();
  }
  std::filesystem::create_directories(path.parent_path(), error);
  const std::filesystem::path temporary = path.string() + ".part";
  std::ofstream file(temporary, std::ios::binary | std::ios::trunc);
  if (!file) return absl::UnavailableError(fmt::format("{}: cannot be written; choose another folder with --out", temporary.string()));

  v1::FetchRequest request;
  request.set_job_id(job_id);
  request.set_name(output.name());
  grpc::ClientContext context;
  const auto reader = schedulers_[in_use_].jobs->Fetch(&context, request);
  base::Hasher hasher;
  v1::FetchChunk chunk;
  while (file && reader->Read(&chunk)) {
    hasher.Update(chunk.data());
    file.write(chunk.data().data(), static_cast<std::streamsize>(chunk.data().size()));
  }
  if (!file) context.TryCancel();
  const grpc::Status status = reader->Finish();
  file.close();
  if (file.fail()) return absl::ResourceExhaustedError(fmt::format("{}: writing failed; is the disk full?", temporary.string()));
  RETURN_IF_ERROR(base::Annotate(rpc::FromGrpc(status), output.name()));
  if (hasher.Finish() != expected)
    return absl::DataLossError(fmt::format("{}: the bytes that arrived do not have the digest {}; fetch again", output.name(), output.sha256()));
  std::filesystem::rename(temporary, path, error);
  if (error) return absl::UnavailableError(fmt::format("{}: {}", path.string(), error.message()));
  return absl::OkStatus();
}

}  // namespace vorocast::client
