// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "proto/capture.grpc.pb.h"
#include "proto/jobs.grpc.pb.h"
#include "services/base/progress.h"
#include "services/base/status.h"
#include "services/capture/capture.h"
#include "services/rpc/security.h"

namespace vorocast::client {

/// What a client asks of a scheduler, as plain calls. Every call has a deadline, except those that stream until the job has ended.
class SchedulerClient {
 public:
  /// Several addresses, separated by commas, are the schedulers of one farm, of which one leads: when that dies, calls are tried again until
  /// another has taken over.
  explicit SchedulerClient(const std::string& address);
  /// With TLS and a token. Errors as rpc::Connect's.
  static absl::StatusOr<SchedulerClient> Open(const std::string& address, const rpc::ClientSecurity& security);

  const std::string& address() const { return address_; }

  /// Opens the capture's sequence, sends all its frames and closes it. May be repeated.
  absl::StatusOr<v1::Sequence> Upload(const capture::Capture& capture, const std::string& session, const base::Progress& progress,
                                      const std::function<bool()>& interrupted);
  /// The sequence that the capture's session and name stand for, as it is; new if there is none.
  absl::StatusOr<v1::Sequence> OpenSequence(const capture::Capture& capture, const std::string& session);
  /// Sends what the store does not have yet of these frames, and adds them. May be repeated. Asks `interrupted` before every frame and ends with
  /// CANCELLED once that says true.
  absl::StatusOr<v1::Sequence> SendFrames(const std::string& sequence_id, const std::vector<capture::CaptureFrame>& frames,
                                          const base::Progress& progress, const std::function<bool()>& interrupted);
  absl::StatusOr<v1::Sequence> CloseSequence(const std::string& sequence_id);

  absl::StatusOr<v1::Job> Submit(const v1::SubmitJobRequest& request);
  absl::StatusOr<v1::Job> Get(const std::string& job_id);
  absl::StatusOr<std::vector<v1::Job>> List(std::int32_t limit);
  /// The newest jobs, of one session if that is not empty, and who works.
  absl::StatusOr<v1::ListJobsReply> ListAll(std::int32_t limit, const std::string& session);
  /// Calls `seen` with each attempt at the job's tasks, in the order that they ended; those that still run come last.
  absl::Status Attempts(const v1::AttemptsRequest& request, const std::function<void(const v1::TaskAttempt&)>& seen);
  /// One result or captured frame ("capture/frame_000412.ply"). RESOURCE_EXHAUSTED when it has more than `bytes_max`.
  absl::StatusOr<std::string> FetchBytes(const std::string& job_id, const std::string& name, std::int64_t bytes_max);
  absl::StatusOr<v1::Job> Cancel(const std::string& job_id);
  absl::StatusOr<v1::Job> Retry(const v1::RetryJobRequest& request);
  absl::StatusOr<v1::Job> Pause(const std::string& job_id);
  absl::StatusOr<v1::Job> Resume(const std::string& job_id);
  absl::StatusOr<std::string> Explain(const std::string& job_id, const std::string& task);

  /// Calls `seen` with the job now and after each change until it has ended; returns its last state. Asks `interrupted` ten times a second
  /// and ends with CANCELLED once that says true.
  absl::StatusOr<v1::Job> Watch(const std::string& job_id, const std::function<void(const v1::Job&)>& seen, const std::function<bool()>& interrupted);

  /// Writes one result to `path` under a temporary name, checks its digest, renames. Does nothing when `path` holds it already.
  absl::Status Fetch(const std::string& job_id, const v1::Output& output, const std::filesystem::path& path);

 private:
  struct Scheduler {
    std::unique_ptr<v1::Captures::Stub> captures;
    std::unique_ptr<v1::Jobs::Stub> jobs;
  };
  SchedulerClient() = default;
  absl::Status UploadBlob(const v1::Blob& blob, const std::filesystem::path& path);
  absl::Status FetchOnce(const std::string& job_id, const v1::Output& output, const std::filesystem::path& path);
  /// Calls `call` with the scheduler in use, and while that is UNAVAILABLE with the next one, for a while.
  absl::Status WithLeader(
      const std::function<absl::Status(const Scheduler&)>& call, const std::function<bool()>& interrupted = [] { return false; });
  template <typename Service, typename Request, typename Reply>
  absl::StatusOr<Reply> Call(std::unique_ptr<Service> Scheduler::*service,
                             grpc::Status (Service::*method)(grpc::ClientContext*, const Request&, Reply*), const Request& request);

  std::string address_;
  std::vector<Scheduler> schedulers_;
  std::size_t in_use_ = 0;
};

}  // namespace vorocast::client
