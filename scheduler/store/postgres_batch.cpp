// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/store/postgres_batch.h"

#include <utility>

namespace vorocast::store {
namespace {

/// A statement whose parameters are arrays of one length; left out when they are empty.
template <typename... Arrays>
void AddStatement(std::vector<PostgresStatement>& statements, const char* sql, Arrays&... arrays) {
  if ((arrays.empty() || ...)) return;
  PostgresStatement& statement = statements.emplace_back();
  statement.sql = sql;
  (statement.parameters.Add(arrays.Take()), ...);
}

}  // namespace

PostgresBatch::PostgresBatch(const std::vector<Record>& records) {
  for (const Record& record : records) std::visit(*this, record);
}

void PostgresBatch::operator()(const core::JobRetried& record) {
  cancelled_[record.job] = false;
  retried_.insert(record.job);
  ended_.erase(record.job);
  std::erase_if(failures_, [&](const auto& failure) { return failure.first.first == record.job; });
}

std::vector<PostgresStatement> PostgresBatch::Statements() const {
  std::vector<PostgresStatement> statements;
  AddCaptures(statements);
  AddJobs(statements);
  AddRuns(statements);
  AddAttempts(statements);
  return statements;
}

void PostgresBatch::AddCaptures(std::vector<PostgresStatement>& statements) const {
  PostgresArray id, session, name, rate, scale, up;
  for (const SequenceOpened* opened : opened_) {
    id.Add(opened->id);
    session.Add(opened->session);
    name.Add(opened->name);
    rate.Add(opened->frames_per_second);
    scale.Add(opened->metres_per_unit);
    up.Add(opened->up);
  }
  AddStatement(statements,
               "INSERT INTO sequence(id, session, name, frames_per_second, metres_per_unit, up) SELECT id, session, name, rate, scale, up FROM "
               "unnest($1::text[], $2::text[], $3::text[], $4::float8[], $5::float8[], $6::text[]) WITH ORDINALITY AS "
               "t(id, session, name, rate, scale, up, n) ORDER BY n ON CONFLICT (id) DO NOTHING",
               id, session, name, rate, scale, up);
  PostgresArray sequence, number, blob, extension, size;
  for (const auto& [key, frame] : frames_) {
    sequence.Add(frame->sequence);
    number.Add(std::int64_t{frame->number});
    blob.Add(frame->blob);
    extension.Add(frame->extension);
    size.Add(frame->size);
  }
  AddStatement(statements,
               "INSERT INTO frame SELECT * FROM unnest($1::text[], $2::int[], $3::bytea[], $4::text[], $5::bigint[]) "
               "ON CONFLICT (sequence, number) DO UPDATE SET blob = excluded.blob, extension = excluded.extension, size = excluded.size",
               sequence, number, blob, extension, size);
  PostgresArray closed;
  for (const std::string& done : closed_) closed.Add(done);
  AddStatement(statements, "UPDATE sequence SET closed = true WHERE id = ANY($1::text[])", closed);
}

void PostgresBatch::AddJobs(std::vector<PostgresStatement>& statements) const {
  PostgresArray id, sequence, user, priority, spec, submitted, workers_max, deadline, memory_limit, time_factor;
  for (const JobAdded* job : jobs_) {
    id.Add(job->id);
    sequence.Add(job->sequence);
    user.Add(job->user);
    priority.Add(std::int64_t{job->priority});
    spec.Add(job->spec_json);
    submitted.Add(job->submitted);
    workers_max.Add(std::int64_t{job->terms.workers_max});
    deadline.Add(job->terms.deadline);
    memory_limit.Add(job->terms.memory_limit);
    time_factor.Add(job->terms.time_factor);
  }
  AddStatement(
      statements,
      "INSERT INTO job(id, sequence, user_name, priority, spec, submitted, workers_max, deadline, memory_limit, time_factor) "
      "SELECT id, sequence, user_name, priority, spec, submitted, workers_max, deadline, memory_limit, time_factor FROM "
      "unnest($1::text[], $2::text[], $3::text[], $4::int[], $5::text[], $6::float8[], $7::int[], $8::float8[], $9::bigint[], $10::float8[]) "
      "WITH ORDINALITY AS t(id, sequence, user_name, priority, spec, submitted, workers_max, deadline, memory_limit, time_factor, n) "
      "ORDER BY n ON CONFLICT (id) DO NOTHING",
      id, sequence, user, priority, spec, submitted, workers_max, deadline, memory_limit, time_factor);
  PostgresArray cancelled, going_on, retried;
  for (const auto& [job, is_cancelled] : cancelled_) (is_cancelled ? cancelled : going_on).Add(job);
  AddStatement(statements, "UPDATE job SET cancelled = true WHERE id = ANY($1::text[])", cancelled);
  AddStatement(statements, "UPDATE job SET cancelled = false WHERE id = ANY($1::text[])", going_on);
  PostgresArray paused, resumed;
  for (const auto& [job, is_paused] : paused_) (is_paused ? paused : resumed).Add(job);
  AddStatement(statements, "UPDATE job SET paused = true WHERE id = ANY($1::text[])", paused);
  AddStatement(statements, "UPDATE job SET paused = false WHERE id = ANY($1::text[])", resumed);
  PostgresArray limited, new_memory_limit, new_time_factor;
  for (const auto& [job, limits] : limited_) {
    limited.Add(job);
    new_memory_limit.Add(limits->memory_limit);
    new_time_factor.Add(limits->time_factor);
  }
  AddStatement(statements,
               "UPDATE job SET memory_limit = t.memory_limit, time_factor = t.time_factor FROM "
               "unnest($1::text[], $2::bigint[], $3::float8[]) AS t(id, memory_limit, time_factor) WHERE job.id = t.id",
               limited, new_memory_limit, new_time_factor);
  for (const std::string& job : retried_) retried.Add(job);
  PostgresArray retried_again = retried;
  AddStatement(statements, "DELETE FROM failure WHERE job = ANY($1::text[])", retried);
  AddStatement(statements, "DELETE FROM ended_job WHERE job = ANY($1::text[])", retried_again);
  PostgresArray of_job, task, cause, message;
  for (const auto& [key, failure] : failures_) {
    of_job.Add(failure->job);
    task.Add(failure->task);
    cause.Add(static_cast<std::int64_t>(failure->cause));
    message.Add(failure->message);
  }
  AddStatement(statements,
               "INSERT INTO failure SELECT * FROM unnest($1::text[], $2::text[], $3::int[], $4::text[]) "
               "ON CONFLICT (job, task) DO UPDATE SET cause = excluded.cause, message = excluded.message",
               of_job, task, cause, message);
  PostgresArray ended, summary, whole, ended_at;
  for (const auto& [job, end] : ended_) {
    ended.Add(job);
    summary.AddBytes(end->summary);
    whole.AddBytes(end->whole);
    ended_at.Add(end->ended);
  }
  AddStatement(statements,
               "INSERT INTO ended_job(job, summary, whole, ended) SELECT * FROM unnest($1::text[], $2::bytea[], $3::bytea[], $4::float8[]) "
               "ON CONFLICT (job) DO UPDATE SET summary = excluded.summary, whole = excluded.whole, ended = excluded.ended",
               ended, summary, whole, ended_at);
}

void PostgresBatch::AddRuns(std::vector<PostgresStatement>& statements) const {
  PostgresArray made, sha256, size, seconds, cpu_seconds, memory_peak, made_for;
  for (const auto& [key, result] : results_) {
    made.Add(key);
    sha256.Add(result->sha256);
    size.Add(result->size);
    seconds.Add(result->seconds);
    cpu_seconds.Add(result->cpu_seconds);
    memory_peak.Add(result->memory_peak);
    made_for.Add(result->made_for);
  }
  AddStatement(
      statements,
      "INSERT INTO result SELECT * FROM unnest($1::bytea[], $2::bytea[], $3::bigint[], $4::float8[], $5::float8[], $6::bigint[], $7::text[]) "
      "ON CONFLICT (key) DO UPDATE SET sha256 = excluded.sha256, size = excluded.size, seconds = excluded.seconds, "
      "cpu_seconds = excluded.cpu_seconds, memory_peak = excluded.memory_peak, made_for = excluded.made_for",
      made, sha256, size, seconds, cpu_seconds, memory_peak, made_for);
  PostgresArray key, attempt, worker, failed, interrupted, memory_raised, time_raised, copy_attempt, copy_worker, ended;
  for (const auto& [run, saved] : runs_) {
    if (!saved) {
      ended.Add(run);
      continue;
    }
    key.Add(run);
    attempt.Add(saved->attempt);
    worker.Add(saved->worker);
    failed.Add(std::int64_t{saved->tries.failed});
    interrupted.Add(std::int64_t{saved->tries.interrupted});
    memory_raised.Add(std::int64_t{saved->tries.memory_raised});
    time_raised.Add(std::int64_t{saved->tries.time_raised});
    copy_attempt.Add(saved->copy_attempt);
    copy_worker.Add(saved->copy_worker);
  }
  AddStatement(statements,
               "INSERT INTO run(key, attempt, worker, failed, interrupted, memory_raised, time_raised, copy_attempt, copy_worker) SELECT * FROM "
               "unnest($1::bytea[], $2::bigint[], $3::text[], $4::int[], $5::int[], $6::int[], $7::int[], $8::bigint[], $9::text[]) "
               "ON CONFLICT (key) DO UPDATE SET attempt = excluded.attempt, worker = excluded.worker, failed = excluded.failed, "
               "interrupted = excluded.interrupted, memory_raised = excluded.memory_raised, time_raised = excluded.time_raised, "
               "copy_attempt = excluded.copy_attempt, copy_worker = excluded.copy_worker",
               key, attempt, worker, failed, interrupted, memory_raised, time_raised, copy_attempt, copy_worker);
  AddStatement(statements, "DELETE FROM run WHERE key = ANY($1::bytea[])", ended);
  if (attempt_next_) {
    statements.push_back({"INSERT INTO counter VALUES('attempt_next', $1) ON CONFLICT (name) DO UPDATE SET value = excluded.value",
                          PostgresParameters().Add(*attempt_next_)});
  }
}

void PostgresBatch::AddAttempts(std::vector<PostgresStatement>& statements) const {
  PostgresArray job, ended, number, task, kind, worker, lasted, outcome, cause, message, cpu_seconds, memory_peak;
  PostgresArray log_job, log_ended, log_number, log_task, log;
  for (const core::AttemptEnded* attempt : attempts_) {
    const std::int64_t at = absl::ToUnixMicros(attempt->ended);
    job.Add(attempt->job);
    ended.Add(at);
    number.Add(attempt->attempt);
    task.Add(attempt->task);
    kind.Add(static_cast<std::int64_t>(attempt->kind));
    worker.Add(attempt->worker);
    lasted.Add(absl::ToInt64Microseconds(attempt->lasted));
    outcome.Add(static_cast<std::int64_t>(attempt->outcome));
    cause.Add(static_cast<std::int64_t>(attempt->cause));
    message.Add(attempt->message);
    cpu_seconds.Add(attempt->cpu_seconds);
    memory_peak.Add(attempt->memory_peak);
    if (attempt->log.empty()) continue;
    log_job.Add(attempt->job);
    log_ended.Add(at);
    log_number.Add(attempt->attempt);
    log_task.Add(attempt->task);
    log.AddBytes(attempt->log);
  }
  AddStatement(statements,
               "INSERT INTO attempt SELECT * FROM unnest($1::text[], $2::bigint[], $3::bigint[], $4::text[], $5::int[], $6::text[], $7::bigint[], "
               "$8::int[], $9::int[], $10::text[], $11::float8[], $12::bigint[]) ON CONFLICT DO NOTHING",
               job, ended, number, task, kind, worker, lasted, outcome, cause, message, cpu_seconds, memory_peak);
  AddStatement(statements,
               "INSERT INTO attempt_log SELECT * FROM unnest($1::text[], $2::bigint[], $3::bigint[], $4::text[], $5::bytea[]) "
               "ON CONFLICT DO NOTHING",
               log_job, log_ended, log_number, log_task, log);
  if (!forgotten_) return;
  statements.push_back(
      {"WITH old AS (SELECT job, ended, number, task FROM attempt WHERE job IN (SELECT job FROM ended_job) AND ended < $1 "
       "ORDER BY job, ended, number, task LIMIT $2), "
       "logs AS (DELETE FROM attempt_log WHERE (job, ended, number, task) IN (SELECT * FROM old)) "
       "DELETE FROM attempt WHERE (job, ended, number, task) IN (SELECT * FROM old)",
       PostgresParameters().Add(absl::ToUnixMicros(forgotten_->before)).Add(forgotten_->count_max)});
}

}  // namespace vorocast::store
