// SPDX-License-Identifier: AGPL-3.0-or-later
// What the scheduler itself costs: durable leases and completions a second through the engine's own turns and commits, and how large queues load,
// answer throughout, come back after a restart in their middle, and run to their end. Workers are simulated in one thread; they take leases and
// report at once, one message a worker at a time, as their streams would. `bench_dispatch large` adds a graph of a million tasks.
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "scheduler/core/job_view.h"
#include "scheduler/server/archive.h"
#include "scheduler/server/catalogue.h"
#include "scheduler/server/engine.h"
#include "scheduler/server/job_message.h"
#include "scheduler/store/postgres_store.h"
#include "scheduler/store/sqlite_store.h"
#include "services/base/check.h"
#include "tests/bench/bench_report.h"
#include "tests/support/temporary_postgres.h"

namespace vorocast::bench {
namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

double ResidentMiB() {
  std::ifstream file("/proc/self/statm");
  double total = 0;
  double resident = 0;
  file >> total >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

void Die(const absl::Status& status) {
  fmt::print(stderr, "bench_dispatch: {}\n", std::string(status.message()));
  std::_Exit(1);
}

/// A scheduler without its sockets, and workers without theirs.
class Farm {
 public:
  Farm(std::unique_ptr<store::Store> store, int workers, int slots) : store_(std::move(store)), workers_(workers), slots_(slots) {
    const auto term = store_->Lead("");
    if (!term.ok()) Die(term.status());
    auto snapshot = store_->Load();
    if (!snapshot.ok()) Die(snapshot.status());
    absl::Status status;
    engine_.Prepare([&](server::Turn& turn) { status = catalogue_.Restore(turn, *std::move(snapshot)); });
    if (!status.ok()) Die(status);
    engine_.Start({.send = [this](core::Message message) { Receive(std::move(message)); },
                   .look_up = [this](std::vector<core::LookUp> asked) { LookUp(std::move(asked)); },
                   .changed =
                       [this](server::Turn& turn, const std::set<std::string>& changed) {
                         if (catalogue_.PlanSome(turn)) engine_.Enqueue([](server::Turn&) {});
                         archive_.Changed(turn, changed);
                       }});
    thread_ = std::thread([this] { Work(); });
  }
  ~Farm() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_all();
    thread_.join();
    engine_.Stop();
  }

  /// One take of so many frames nobody has seen before, and a job on it.
  void Submit(int take, int frames) {
    InTurn([&](server::Turn& turn) {
      const auto opened = catalogue_.Open(turn, {.session = "bench", .name = fmt::format("take {}", take), .up = "+y"});
      std::vector<store::FrameAdded> added;
      for (int i = 0; i < frames; ++i) {
        added.push_back({.number = i, .blob = base::HashBytes(fmt::format("{} {} {}", getpid(), take, i)), .extension = ".ply", .size = 1});
      }
      const std::string id = (*opened)->opened.id;
      VOROCAST_CHECK(catalogue_.Add(turn, id, added).ok() && catalogue_.Close(turn, id).ok());
      VOROCAST_CHECK(catalogue_.Submit(turn, id, "bench", 0, plan::JobSpec{.sheets = false}).ok());
    });
  }
  void ConnectWorkers() {
    for (int i = 1; i <= workers_; ++i) {
      core::WorkerConnected connected{.connection = static_cast<core::ConnectionId>(i), .worker = fmt::format("worker-{}", i), .slots = slots_};
      connected.kinds.assign(std::begin(tasks::kAllKinds), std::end(tasks::kAllKinds));
      engine_.Enqueue([connected](server::Turn& turn) { turn.Apply(connected); });
    }
  }
  /// Until so many tasks have been completed, durably, since the start.
  void AwaitCompleted(std::int64_t tasks) {
    std::unique_lock lock(mutex_);
    done_.wait(lock, [&] { return acknowledged_ >= tasks; });
  }
  void AwaitFirstLease() {
    std::unique_lock lock(mutex_);
    done_.wait(lock, [&] { return leased_ > 0; });
  }
  /// Until every job has ended, with a result for each of its tasks.
  void AwaitJobsDone(int jobs) {
    for (int ended = 0; ended < jobs;) {
      InTurn([&](server::Turn&) {
        const auto job = catalogue_.FindJob(fmt::format("j{}", ended + 1));
        if (job.ok() && (*job)->ended) ++ended;
      });
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  /// Until the core knows so many tasks; returns how many it knows.
  std::int64_t AwaitPlanned(std::int64_t tasks) {
    std::int64_t count = 0;
    while (count < tasks) {
      InTurn([&](server::Turn& turn) { count = static_cast<std::int64_t>(turn.state().tasks.size()); });
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return count;
  }
  /// What `vorocast status` of the newest job waits for, but for the network.
  double StatusMs() {
    const auto start = Clock::now();
    InTurn([&](server::Turn& turn) {
      const auto job = catalogue_.FindJob(fmt::format("j{}", turn.state().jobs.size()));
      if (job.ok()) (void)server::JobMessage(turn.state(), catalogue_, **job, server::FrameOutputs::kLeftOut);
    });
    return 1000 * SecondsSince(start);
  }

 private:
  void InTurn(const std::function<void(server::Turn&)>& work) {
    std::mutex mutex;
    std::condition_variable ended;
    bool over = false;
    const absl::Status accepted = engine_.Ask([&](server::Turn& turn) {
      work(turn);
      turn.After([&] {
        const std::lock_guard lock(mutex);
        over = true;
        ended.notify_all();
      });
    });
    if (!accepted.ok()) Die(accepted);
    std::unique_lock lock(mutex);
    ended.wait(lock, [&] { return over; });
  }
  void Receive(core::Message message) {
    const std::lock_guard lock(mutex_);
    if (const auto* leases = std::get_if<core::Leases>(&message.content)) {
      leased_ += static_cast<std::int64_t>(leases->leases.size());
      for (const core::Lease& lease : leases->leases) outbox_[message.connection].push_back(lease.id);
      if (!in_flight_.contains(message.connection)) to_send_.push_back(message.connection), in_flight_.insert(message.connection);
    } else if (const auto* acknowledged = std::get_if<core::Acknowledge>(&message.content)) {
      acknowledged_ += static_cast<std::int64_t>(acknowledged->ids.size());
    }
    wake_.notify_one();
    done_.notify_all();
  }
  void LookUp(std::vector<core::LookUp> asked) {
    const std::lock_guard lock(mutex_);
    for (core::LookUp& look_up : asked) asked_.push_back(look_up.key);
    wake_.notify_one();
  }
  void Work() {
    while (true) {
      std::deque<core::ConnectionId> senders;
      std::vector<core::LookUpAnswered> answers;
      {
        std::unique_lock lock(mutex_);
        wake_.wait(lock, [this] { return stopping_ || !to_send_.empty() || !asked_.empty(); });
        if (stopping_) return;
        std::swap(senders, to_send_);
        for (int i = 0; i < 256 && !asked_.empty(); ++i) {
          answers.push_back({.key = asked_.front()});
          asked_.pop_front();
        }
      }
      if (!answers.empty()) {
        engine_.Enqueue([answers = std::move(answers)](server::Turn& turn) {
          for (const core::LookUpAnswered& answer : answers) turn.Apply(answer);
        });
      }
      for (const core::ConnectionId sender : senders) Report(sender);
    }
  }
  void Report(core::ConnectionId sender) {
    core::Finished finished{.connection = sender};
    {
      const std::lock_guard lock(mutex_);
      std::deque<core::AttemptId>& outbox = outbox_[sender];
      if (outbox.empty()) {
        in_flight_.erase(sender);
        return;
      }
      finished.id = outbox.front();
      outbox.pop_front();
    }
    finished.outcome = core::Succeeded{{.sha256 = finished.id.key, .size = 1'000'000, .seconds = 1, .cpu_seconds = 1, .memory_peak = 100'000'000}};
    engine_.Enqueue([this, finished](server::Turn& turn) {
      turn.Apply(finished);
      turn.After([this, sender = finished.connection] {
        const std::lock_guard lock(mutex_);
        to_send_.push_back(sender);
        wake_.notify_one();
      });
    });
  }

  std::unique_ptr<store::Store> store_;
  const int workers_;
  const int slots_;
  server::Engine engine_{*store_, Die};
  server::Catalogue catalogue_{*store_};
  server::Archive archive_{catalogue_};
  std::mutex mutex_;
  std::condition_variable wake_;
  std::condition_variable done_;
  std::deque<core::ConnectionId> to_send_;                            // guarded by mutex_
  std::map<core::ConnectionId, std::deque<core::AttemptId>> outbox_;  // guarded by mutex_
  std::set<core::ConnectionId> in_flight_;                            // guarded by mutex_: one message at a time
  std::deque<base::Digest> asked_;                                    // guarded by mutex_
  std::int64_t leased_ = 0;                                           // guarded by mutex_
  std::int64_t acknowledged_ = 0;                                     // guarded by mutex_
  bool stopping_ = false;                                             // guarded by mutex_
  std::thread thread_;
};

using OpenStore = std::function<std::unique_ptr<store::Store>()>;

constexpr int kFrames = 2000;

BenchCase Dispatch(const std::string& name, const OpenStore& open, int workers, int slots, int takes, double goal) {
  Farm farm(open(), workers, slots);
  for (int take = 0; take < takes; ++take) farm.Submit(take, kFrames);
  // The last tasks of a take wait for one another; that is not dispatching.
  const auto tasks = static_cast<std::int64_t>(takes) * kFrames;
  farm.AwaitPlanned(tasks);
  const double cpu = CpuSeconds();
  const auto start = Clock::now();
  farm.ConnectWorkers();
  farm.AwaitCompleted(tasks);
  BenchCase result{.name = name, .cpu_s = CpuSeconds() - cpu};
  result.quality["min_tasks_per_s"] = static_cast<double>(tasks) / SecondsSince(start);
  result.quality["tasks_per_cpu_s"] = static_cast<double>(tasks) / result.cpu_s;
  if (goal > 0) result.goal["min_tasks_per_s"] = goal;
  return result;
}

/// Asks a farm for its status every 2 ms, for as long as it lives.
class StatusProbe {
 public:
  explicit StatusProbe(Farm& farm)
      : thread_([this, &farm] {
          while (!over_) {
            max_ms_ = std::max(max_ms_, farm.StatusMs());
            std::this_thread::sleep_for(std::chrono::milliseconds(2));
          }
        }) {}
  double Stop() {
    over_ = true;
    thread_.join();
    return max_ms_;
  }

 private:
  std::atomic<bool> over_ = false;
  double max_ms_ = 0;
  std::thread thread_;
};

/// Loads so many tasks, runs the first of them, starts again in the middle, and runs all the others.
BenchCase Growth(const std::string& name, const OpenStore& open, std::int64_t tasks) {
  constexpr int kWorkers = 100;
  const int jobs = static_cast<int>((tasks + kFrames - 1) / kFrames);
  BenchCase result{.name = name};
  result.goal = {{"status_max_ms", 50}, {"resident_mib", 2048}, {"restart_s", 2}};
  const double cpu = CpuSeconds();
  {
    Farm farm(open(), kWorkers, 1);
    StatusProbe probe(farm);
    const auto start = Clock::now();
    for (int take = 0; take < jobs; ++take) farm.Submit(take, kFrames);
    const std::int64_t planned = farm.AwaitPlanned(tasks);
    result.quality["load_s"] = SecondsSince(start);
    farm.ConnectWorkers();
    farm.AwaitCompleted(std::min<std::int64_t>(2000, tasks / 10));
    result.quality["tasks"] = static_cast<double>(planned);
    result.quality["status_max_ms"] = probe.Stop();
    result.quality["resident_mib"] = ResidentMiB();
  }
  const double restart_cpu = CpuSeconds();
  const auto start = Clock::now();
  {
    Farm farm(open(), kWorkers, 1);
    farm.ConnectWorkers();
    farm.AwaitFirstLease();
    result.quality["restart_s"] = SecondsSince(start);
    result.quality["restart_cpu_s"] = CpuSeconds() - restart_cpu;
    StatusProbe probe(farm);
    farm.AwaitJobsDone(jobs);
    result.quality["run_s"] = SecondsSince(start);
    result.quality["status_max_ms"] = std::max(result.quality["status_max_ms"], probe.Stop());
    result.quality["resident_mib"] = std::max(result.quality["resident_mib"], ResidentMiB());
  }
  result.cpu_s = CpuSeconds() - cpu;
  return result;
}

int Main(int argc, char** argv) {
  BenchReport report(argc, argv);
  spdlog::set_level(spdlog::level::warn);
  const bool large = std::ranges::count(report.arguments(), "large") > 0;
  std::string folder = (std::filesystem::temp_directory_path() / "vorocast-dispatch-XXXXXX").string();
  VOROCAST_CHECK(mkdtemp(folder.data()) != nullptr);
  int number = 0;
  const auto sqlite = [&](int database) {
    const std::filesystem::path path = std::filesystem::path(folder) / std::to_string(database) / "scheduler.db";
    std::filesystem::create_directories(path.parent_path());
    auto store = store::OpenSqliteStore(path);
    if (!store.ok()) Die(store.status());
    return *std::move(store);
  };
  const auto fresh = [&] { return [&sqlite, database = ++number] { return sqlite(database); }; };

  report.Add(Dispatch("dispatch-sqlite", fresh(), 500, 8, 10, 10'000));
  if (const auto server = support::TemporaryPostgres::Start(/*durable=*/true)) {
    const OpenStore postgres = [&] { return *store::OpenPostgresStore(server->Url("bench")); };
    report.Add(Dispatch("dispatch-postgres", postgres, 500, 8, 10, 5'000));
  } else {
    fmt::print("dispatch-postgres: PostgreSQL is not installed\n");
  }
  for (const int workers : {1, 100, 10'000}) {
    report.Add(Dispatch(fmt::format("dispatch-sqlite-{}-workers", workers), fresh(), workers, 1, workers == 1 ? 1 : 10, 0));
  }
  report.Add(Growth("graph-10k", fresh(), 10'000));
  report.Add(Growth("graph-100k", fresh(), 100'000));
  if (large) report.Add(Growth("graph-1m", fresh(), 1'000'000));

  std::error_code ignored;
  std::filesystem::remove_all(folder, ignored);
  const absl::Status status = report.Write();
  if (!status.ok()) Die(status);
  return 0;
}

}  // namespace
}  // namespace vorocast::bench

int main(int argc, char** argv) { return vorocast::bench::Main(argc, argv); }
