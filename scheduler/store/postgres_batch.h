// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "scheduler/store/postgres_connection.h"
#include "scheduler/store/store.h"

namespace vorocast::store {

/// What a batch of records comes down to: for each row its last value. So a batch of any size is a handful of statements over arrays,
/// and the order among its records is kept where it matters.
class PostgresBatch {
 public:
  explicit PostgresBatch(const std::vector<Record>& records);
  std::vector<PostgresStatement> Statements() const;

  // One for each kind of record; called by the constructor.
  void operator()(const SequenceOpened& record) { opened_.push_back(&record); }
  void operator()(const FrameAdded& record) { frames_[{record.sequence, record.number}] = &record; }
  void operator()(const SequenceClosed& record) { closed_.insert(record.sequence); }
  void operator()(const JobAdded& record) { jobs_.push_back(&record); }
  void operator()(const JobEnded& record) { ended_[record.job] = &record; }
  void operator()(const AttemptsForgotten& record) { forgotten_ = record; }
  void operator()(const core::Record& record) { std::visit(*this, record); }
  void operator()(const core::ResultMade& record) { results_[record.key] = &record.result; }
  void operator()(const core::TaskFailed& record) { failures_[{record.job, record.task}] = &record; }
  void operator()(const core::RunSaved& record) { runs_[record.key] = &record; }
  void operator()(const core::RunEnded& record) { runs_[record.key] = nullptr; }
  void operator()(const core::AttemptsReserved& record) { attempt_next_ = record.next; }
  void operator()(const core::JobCancelled& record) { cancelled_[record.job] = true; }
  void operator()(const core::JobRetried& record);
  void operator()(const core::JobPaused& record) { paused_[record.job] = record.paused; }
  void operator()(const core::JobLimited& record) { limited_[record.job] = &record; }
  void operator()(const core::AttemptEnded& record) { attempts_.push_back(&record); }

 private:
  void AddCaptures(std::vector<PostgresStatement>& statements) const;
  void AddJobs(std::vector<PostgresStatement>& statements) const;
  void AddRuns(std::vector<PostgresStatement>& statements) const;
  void AddAttempts(std::vector<PostgresStatement>& statements) const;

  // The records must outlive the batch, as all of these point into them.
  std::vector<const SequenceOpened*> opened_;
  std::map<std::pair<std::string, std::int32_t>, const FrameAdded*> frames_;
  std::set<std::string> closed_;
  std::vector<const JobAdded*> jobs_;
  std::map<std::string, const JobEnded*> ended_;
  std::map<std::string, bool> cancelled_;
  std::map<std::string, bool> paused_;
  std::map<std::string, const core::JobLimited*> limited_;
  std::set<std::string> retried_;  // whose older failures and end go first
  std::map<std::pair<std::string, std::string>, const core::TaskFailed*> failures_;
  std::map<base::Digest, const core::Result*> results_;
  std::map<base::Digest, const core::RunSaved*> runs_;  // null: ended
  std::optional<std::int64_t> attempt_next_;
  std::vector<const core::AttemptEnded*> attempts_;
  std::optional<AttemptsForgotten> forgotten_;
};

}  // namespace vorocast::store
