// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "scheduler/core/check.h"
#include "scheduler/core/job_view.h"
#include "scheduler/core/step.h"

namespace vorocast::core {

/// Drives the core by hand: look-ups are answered at once with what has been made so far, what it sends is kept.
class CoreBench {
 public:
  CoreBench() { Happen(Restored{}); }

  void Happen(Event event) {
    Effects effects = Step(state, std::move(event), now);
    const absl::Status status = Check(state);
    EXPECT_TRUE(status.ok()) << status;
    for (Message& message : effects.messages) messages.push_back(std::move(message));
    for (Record& record : effects.records) {
      if (const auto* made = std::get_if<ResultMade>(&record)) results[made->key] = made->result;
      records.push_back(std::move(record));
    }
    for (const LookUp& look_up : effects.look_ups) {
      looked_up.push_back(look_up.key);
      if (look_up.verify) ++verified;
      const auto found = results.find(look_up.key);
      if (answer) Happen(LookUpAnswered{look_up.key, found == results.end() ? std::nullopt : std::optional(found->second), true});
    }
  }
  void Pass(absl::Duration time) {
    for (absl::Duration passed; passed < time; passed += absl::Milliseconds(100)) {
      now += absl::Milliseconds(100);
      Happen(Tick{});
    }
  }
  void Job(const std::string& id, std::int32_t frames, const std::string& user = "anna", std::int32_t priority = 0, std::int32_t first = 0,
           const JobTerms& terms = {}) {
    Happen(JobSubmitted{.id = id, .name = "take", .user = user, .priority = priority, .terms = terms});
    plan::JobSpec spec;
    std::vector<plan::PlannedFrame> take;
    for (std::int32_t i = first; i < first + frames; ++i) {
      take.push_back({.number = i, .blob = base::HashBytes(fmt::format("{}", i)), .extension = ".ply"});
    }
    Happen(TasksAdded{.job = id, .tasks = *plan::Plan(spec, take, true), .complete = true, .bad_frames_max = 1});
  }
  void Connect(ConnectionId connection, const std::string& name, std::int32_t slots = 1, std::vector<AttemptId> holding = {}) {
    Happen(WorkerConnected{connection, name, {std::begin(tasks::kAllKinds), std::end(tasks::kAllKinds)}, slots, std::move(holding)});
  }
  /// Leases sent since the last call.
  std::vector<Lease> TakeLeases(ConnectionId connection) {
    std::vector<Lease> leases;
    std::erase_if(messages, [&](const Message& message) {
      const auto* sent = std::get_if<Leases>(&message.content);
      if (!sent || message.connection != connection) return false;
      leases.insert(leases.end(), sent->leases.begin(), sent->leases.end());
      return true;
    });
    return leases;
  }
  std::vector<std::string> TakeLabels(ConnectionId connection) {
    std::vector<std::string> labels;
    for (const Lease& lease : TakeLeases(connection)) labels.push_back(lease.label);
    return labels;
  }
  void Succeed(ConnectionId connection, const AttemptId& id) { Happen(Finished{connection, id, Succeeded{{.size = 1, .seconds = 2}}}); }
  void Fail(ConnectionId connection, const AttemptId& id, Cause cause) { Happen(Finished{connection, id, AttemptFailed{cause, "broken"}}); }
  std::string Explained(const std::string& job, const std::string& task) { return *Explain(state, *FindJob(state, job), task); }
  template <typename R>
  std::int64_t Count() const {
    return std::count_if(records.begin(), records.end(), [](const Record& record) { return std::holds_alternative<R>(record); });
  }

  State state;
  absl::Time now = absl::UnixEpoch();
  bool answer = true;
  std::vector<Message> messages;
  std::vector<Record> records;
  std::vector<base::Digest> looked_up;
  int verified = 0;
  std::map<base::Digest, Result> results;
};

}  // namespace vorocast::core
