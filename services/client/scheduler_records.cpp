// SPDX-License-Identifier: AGPL-3.0-or-later
// What a client reads of a scheduler's records.
#include <fmt/format.h>
#include <grpcpp/grpcpp.h>

#include "absl/time/clock.h"
#include "services/base/digest.h"
#include "services/client/scheduler_client.h"
#include "services/rpc/status.h"

namespace vorocast::client {
namespace {

/// For one answer, or one whole stream of them.
constexpr absl::Duration kPatience = absl::Minutes(5);

void SetDeadline(grpc::ClientContext& context) { context.set_deadline(absl::ToChronoTime(absl::Now() + kPatience)); }

}  // namespace

absl::StatusOr<v1::ListJobsReply> SchedulerClient::ListAll(std::int32_t limit, const std::string& session) {
  v1::ListJobsRequest request;
  request.set_limit(limit);
  request.set_session(session);
  v1::ListJobsReply reply;
  RETURN_IF_ERROR(WithLeader([&](const Scheduler& scheduler) {
    grpc::ClientContext context;
    SetDeadline(context);
    return rpc::FromGrpc(scheduler.jobs->List(&context, request, &reply));
  }));
  return reply;
}

absl::Status SchedulerClient::Attempts(const v1::AttemptsRequest& request, const std::function<void(const v1::TaskAttempt&)>& seen) {
  std::size_t passed_on = 0;
  return WithLeader([&](const Scheduler& scheduler) {
    grpc::ClientContext context;
    SetDeadline(context);
    const auto reader = scheduler.jobs->Attempts(&context, request);
    v1::AttemptsReply reply;
    std::size_t read = 0;
    while (reader->Read(&reply)) {
      for (const v1::TaskAttempt& attempt : reply.attempts()) {
        // The stream of a scheduler that took over begins anew; ended attempts keep their order.
        if (++read <= passed_on) continue;
        ++passed_on;
        seen(attempt);
      }
    }
    return rpc::FromGrpc(reader->Finish());
  });
}

absl::StatusOr<std::string> SchedulerClient::FetchBytes(const std::string& job_id, const std::string& name, std::int64_t bytes_max) {
  v1::FetchRequest request;
  request.set_job_id(job_id);
  request.set_name(name);
  std::string bytes;
  std::string sha256;
  RETURN_IF_ERROR(WithLeader([&](const Scheduler& scheduler) -> absl::Status {
    grpc::ClientContext context;
    SetDeadline(context);
    const auto reader = scheduler.jobs->Fetch(&context, request);
    bytes.clear();
    v1::FetchChunk chunk;
    while (reader->Read(&chunk)) {
      if (!chunk.sha256().empty()) sha256 = chunk.sha256();
      bytes += chunk.data();
      if (static_cast<std::int64_t>(bytes.size()) <= bytes_max && chunk.size() <= bytes_max) continue;
      context.TryCancel();
      (void)reader->Finish();
      return absl::ResourceExhaustedError(fmt::format("{} has more than {} bytes", name, bytes_max));
    }
    return rpc::FromGrpc(reader->Finish());
  }));
  if (base::HashBytes(bytes).Hex() != sha256) return absl::DataLossError(fmt::format("{}: the bytes that arrived do not have their digest", name));
  return bytes;
}

}  // namespace vorocast::client
