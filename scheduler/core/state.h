// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <variant>
#include <vector>

#include "absl/container/btree_map.h"
#include "absl/container/flat_hash_map.h"
#include "absl/time/time.h"
#include "scheduler/core/block_table.h"
#include "scheduler/core/event.h"
#include "scheduler/core/record.h"

/// All that the scheduler knows. A job has tasks; tasks that want the same result (equal keys, of any job) share one run; a run is what is
/// leased to a worker. Everything is reached by dense indices or by key, and no event looks at all tasks.
namespace vorocast::core {

using JobIndex = std::uint32_t;
using TaskIndex = std::uint32_t;
using RunIndex = std::uint32_t;
using WorkerIndex = std::uint32_t;
inline constexpr std::uint32_t kNone = 0xffffffff;
inline constexpr std::size_t kKinds = std::size(tasks::kAllKinds);

// ---- A task's state, each with its own data.

struct Blocked {
  std::uint32_t unmet = 0;  // inputs whose tasks have not ended
};
struct Wanted {
  RunIndex run = kNone;  // which says whether it is looked up, ready or leased
};
struct Done {
  base::Digest key;
  Result result;
  bool reused = false;  // made for another job
};
struct Failed {
  Cause cause = Cause::kInternal;
  std::string message;
};
struct Cancelled {};
using TaskState = std::variant<Blocked, Wanted, Done, Failed, Cancelled>;

struct TaskInput {
  std::string role;
  std::int32_t frame = -1;
  TaskIndex task = kNone;  // kNone: a blob
  base::Digest blob;
  std::string extension;
  bool optional = false;
};

struct Task {
  JobIndex job = kNone;  // kNone: forgotten
  tasks::Kind kind = tasks::Kind::kTessellate;
  std::string name;
  std::shared_ptr<const nlohmann::json> options;  // shared by tasks with equal ones
  std::vector<TaskInput> inputs;
  std::vector<TaskIndex> dependents;  // once for each input that reads this
  std::string output;
  TaskState state = Blocked{};
};

// ---- A run's state.

struct LookingUp {};  // asked whether the result exists
struct Ready {};
struct Resting {
  absl::Time until;
  std::string why;  // how the last attempt ended
};
/// A worker at work on a run.
struct Attempt {
  std::int64_t number = 0;
  WorkerIndex worker = kNone;
  absl::Time deadline;  // of its lease
  absl::Time started;   // as far as this process knows
  double fraction = 0;
  JobIndex job = kNone;            // whose limit and whose user's share it counts against; kNone: nobody's
  std::int32_t memory_raised = 0;  // the limits that it was given, as in Tries
  std::int32_t time_raised = 0;
};
struct Leased {
  /// One, or two on different workers when the first takes long: the first result counts.
  std::vector<Attempt> attempts;
};
using RunState = std::variant<LookingUp, Ready, Resting, Leased>;

struct Run {
  base::Digest key;
  tasks::Kind kind = tasks::Kind::kTessellate;
  /// Never empty, but for a run that is still leased from before a restart and whose task has not been planned again yet.
  std::vector<TaskIndex> tasks;
  Tries tries;
  bool saved = false;  // the store has a RunSaved of it
  /// Serial numbers of the workers that failed it in a way that could be their fault: until `avoid_until` others go first.
  std::vector<std::int64_t> failed_on;
  absl::Time avoid_until = absl::InfinitePast();
  RunState state = LookingUp{};
};

/// What the last attempts of one kind took, for a median that follows the job: takes differ in size, and so do their parts.
struct RecentTimes {
  static constexpr std::size_t kKept = 63;
  std::vector<float> seconds;  // the oldest is written over first
  std::size_t next = 0;
  void Add(double value);
  /// 0 while too few are known.
  double Median() const;
};

/// What users see of a task, and what is counted.
enum class Phase : std::uint8_t { kBlocked, kReady, kRunning, kDone, kFailed, kCancelled };
inline constexpr std::size_t kPhases = 6;

struct KindCounts {
  std::array<std::int32_t, kPhases> phase{};
  std::int32_t reused = 0;
  double seconds = 0;         // of the done ones that were not reused
  std::int32_t measured = 0;  // how many those are
};

struct Job {
  std::string id;
  std::string name;
  std::string user;
  std::int32_t priority = 0;
  JobTerms terms;
  bool complete = false;  // every task is planned
  bool cancelled = false;
  bool paused = false;
  bool verify = false;                    // results that exist are read before they are believed
  std::optional<std::string> stopped;     // why nothing more is started: too many bad frames, or the rest cannot be planned
  std::optional<std::string> impossible;  // the part of `stopped` that a retry does not forget
  std::int32_t bad_frames_max = -1;
  std::int32_t bad_frames = 0;
  std::vector<TaskIndex> tasks;
  absl::flat_hash_map<std::string, TaskIndex> by_name;
  absl::flat_hash_map<std::string, TaskFailed> failed_before;  // a restart's memory, by task name
  std::array<KindCounts, kKinds> counts;
  std::set<TaskIndex> running;
  std::set<TaskIndex> failed;  // of their own doing
  std::array<RecentTimes, kKinds> recent;
  /// How many inputs of its tasks of one kind are results of tasks of another: what the stages wait for, without a look at the tasks.
  std::array<std::array<std::int32_t, kKinds>, kKinds> reads{};
  /// Ready runs that it wants, in the order of the plan; a run that several jobs want stands with each of them.
  std::array<std::set<std::pair<TaskIndex, RunIndex>>, kKinds> ready;
  std::int32_t at_work = 0;  // attempts that count against its limit
  std::uint32_t listed = 0;  // kinds, as bits, under which its group has it

  bool has_room() const { return terms.workers_max == 0 || at_work < terms.workers_max; }
  /// Whether it may be given workers for what is ready.
  bool is_open() const { return !paused && !starts_nothing() && has_room(); }
  bool has_too_many_bad_frames() const { return bad_frames_max >= 0 && bad_frames > bad_frames_max; }
  bool starts_nothing() const { return cancelled || stopped.has_value(); }
};

/// Whether a worker can be trusted with tasks.
struct Health {
  struct Trial {
    std::uint64_t run = 0;  // the head of its key
    bool failed = false;    // in a way that could be the worker's fault
  };
  std::vector<Trial> trials;  // the last ones, oldest first
  bool set_aside = false;
  bool on_probation = false;  // back after a rest, with one slot
  absl::Time until;           // of the rest
  std::string reason;
  std::int32_t rests = 0;      // in a row; each is longer than the one before
  std::int32_t successes = 0;  // on probation
};

struct Worker {
  std::string name;
  std::uint32_t kinds = 0;  // bit set by tasks::Kind
  std::int32_t slots = 0;
  ConnectionId connection = 0;  // 0: away
  bool leaving = false;
  bool silent = false;  // a lease ran out although the stream stands; gets nothing until it is heard again
  std::set<RunIndex> runs;
  std::int64_t serial = 0;  // never used twice, unlike its index
  Health health;
  bool is_there() const { return connection != 0 && !leaving && !silent; }
  std::int32_t free() const {
    if (!is_there() || health.set_aside) return 0;
    return (health.on_probation ? 1 : slots) - static_cast<std::int32_t>(runs.size());
  }
};

/// Where a job stands among its user's: the earlier deadline first, then who came first. Jobs without a deadline come last.
using JobPlace = std::pair<double, JobIndex>;
/// One user's jobs of one priority that may be given workers, by the kinds of what they have ready. Within a job the order of the plan holds, so
/// that a take flows through to its end.
struct Group {
  std::array<std::set<JobPlace>, kKinds> jobs;
};
struct GroupKey {
  std::int32_t priority = 0;
  std::string user;
  friend bool operator<(const GroupKey& a, const GroupKey& b) { return a.priority != b.priority ? a.priority > b.priority : a.user < b.user; }
};

struct Settings {
  absl::Duration lease = absl::Seconds(10);        // without a sign of life
  absl::Duration grace = absl::Milliseconds(800);  // for a broken stream to come back
  absl::Duration stall = absl::Seconds(3);         // a longer gap between ticks means that this process itself was stopped
  std::int64_t memory_limit = std::int64_t{8} << 30;
};

struct State {
  Settings settings;
  std::vector<Job> jobs;
  absl::flat_hash_map<std::string, JobIndex> job_by_id;
  BlockTable<Task> tasks;
  BlockTable<Run> runs;
  std::vector<RunIndex> free_runs;
  absl::btree_map<base::Digest, RunIndex> run_by_key;  // a hash table of a million entries stops everybody when it grows
  std::map<base::Digest, Tries> tries_before;          // a restart's memory of runs that nobody held
  absl::Time adoption_ends = absl::InfiniteFuture();   // afterwards what a restart remembered and nobody wants is forgotten
  std::vector<Worker> workers;
  std::vector<WorkerIndex> free_workers;
  absl::flat_hash_map<std::string, WorkerIndex> worker_by_name;
  absl::flat_hash_map<ConnectionId, WorkerIndex> worker_by_connection;
  std::map<GroupKey, Group> groups;                                              // never an empty one
  std::map<std::string, std::int32_t> leased_by_user;                            // slots that work for each user, over all priorities
  std::map<std::uint32_t, std::set<std::pair<std::int32_t, WorkerIndex>>> idle;  // by kinds: (−free slots, worker)
  std::set<std::tuple<absl::Time, RunIndex, std::int64_t>> deadlines;            // of attempts, by number, and of resting runs under 0
  std::set<std::pair<absl::Time, WorkerIndex>> set_aside;                        // by the end of their rest
  std::int64_t worker_serial = 0;
  absl::Time copies_next = absl::InfinitePast();  // when tasks that take long are looked for again
  std::int64_t attempt_next = 1;
  std::int64_t attempt_reserved = 1;
  absl::Time last_tick = absl::InfinitePast();
};

Phase PhaseOf(const State& state, const Task& task);
inline bool HasEnded(const Task& task) { return !std::holds_alternative<Blocked>(task.state) && !std::holds_alternative<Wanted>(task.state); }
/// With the inputs as they are now; those that failed are missing. All inputs must have ended.
tasks::TaskSpec SpecOf(const State& state, const Task& task);
/// Every task is known and has ended; a retry may make it go on.
bool IsOver(const Job& job);
const Job* FindJob(const State& state, const std::string& id);
JobPlace PlaceOf(const Job& job, JobIndex index);

}  // namespace vorocast::core
