// SPDX-License-Identifier: AGPL-3.0-or-later
// A whole take through the service, as a user runs it: `vorocast run` with two local workers, frames in, tracked.h5 out, beside the goals.
// Usage: bench_take [--frames N] [--points N] [--cells N] [--patches N] [--growth] [--json FILE]. Frames are scanned from the crane capture
// (VOROCAST_DATA), or made up where it is absent. --growth prints how time and memory grow, from small takes, as Markdown (docs/scaling.md).
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "services/capture/capture.h"
#include "services/storage/hdf5_artifacts.h"
#include "services/storage/truth.h"
#include "services/synth/synth.h"
#include "tests/bench/bench_report.h"
#include "workers/tracking/tracking.h"

namespace vorocast::bench {
namespace {

constexpr double kGoalWall = 60;
constexpr double kGoalCpu = 120;
constexpr double kGoalMiB = 1024;
constexpr double kNoise = 0.001;

struct TakeSize {
  std::int32_t frames = 126;  // the paper's Runner
  std::int32_t points = 65'000;
  std::int32_t cells = 5000;
  std::int32_t patches = 200;
};

/// What the tasks of one kind took.
struct Stage {
  std::int32_t tasks = 0;
  double cpu_s = 0;
  double peak_mib = 0;
  double megabytes = 0;
};

struct TakeRun {
  double wall_s = 0;
  double cpu_s = 0;  // of all tasks
  double peak_mib = 0;
  double mean_mm = 0;
  double p95_mm = 0;
  std::map<std::string, Stage> stages;  // by kind
};

/// A folder that goes when the benchmark ends.
class ScratchFolder {
 public:
  ScratchFolder() : path_(std::filesystem::temp_directory_path() / fmt::format("vorocast_bench_take_{}", getpid())) {
    std::filesystem::create_directories(path_);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

absl::Status MakeCapture(const TakeSize& size, const std::filesystem::path& folder) {
  const std::filesystem::path crane = std::filesystem::path(DataFolder()) / "crane";
  synth::SynthOptions options;
  options.points = size.points;
  options.noise_m = kNoise;
  options.frames = size.frames;
  if (!std::filesystem::exists(crane)) return synth::SynthesiseCapture(folder, options);
  return synth::ScanMeshes(crane, {.last = size.frames}, folder, options);
}

absl::StatusOr<double> SecondsOf(const std::vector<std::string>& command, const std::filesystem::path& log) {
  const auto begin = std::chrono::steady_clock::now();
  std::fflush(stdout);  // else the child would print it too
  const pid_t child = fork();
  if (child < 0) return absl::ResourceExhaustedError("no process can be started");
  if (child == 0) {
    if (!std::freopen(log.c_str(), "w", stdout) || dup2(STDOUT_FILENO, STDERR_FILENO) < 0) _exit(126);
    std::vector<char*> arguments;
    for (const std::string& argument : command) arguments.push_back(const_cast<char*>(argument.c_str()));
    arguments.push_back(nullptr);
    execv(arguments[0], arguments.data());
    _exit(127);
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) return absl::InternalError(fmt::format("{} failed; see {}", command[0], log.string()));
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

std::string Hex(const void* bytes, int size) {
  std::string hex;
  for (int i = 0; i < size; ++i) hex += fmt::format("{:02x}", static_cast<const unsigned char*>(bytes)[i]);
  return hex;
}

/// The scheduler has written down what each task took, under the key that names its result.
absl::Status ReadStages(const std::filesystem::path& state, TakeRun& run) {
  sqlite3* opened = nullptr;
  const int code = sqlite3_open_v2((state / "scheduler.db").c_str(), &opened, SQLITE_OPEN_READONLY, nullptr);
  const std::unique_ptr<sqlite3, decltype(&sqlite3_close)> database(opened, &sqlite3_close);
  sqlite3_stmt* prepared = nullptr;
  if (code != SQLITE_OK ||
      sqlite3_prepare_v2(opened, "SELECT key, size, cpu_seconds, memory_peak FROM result", -1, &prepared, nullptr) != SQLITE_OK) {
    return absl::InternalError(fmt::format("the scheduler's database cannot be read: {}", sqlite3_errmsg(opened)));
  }
  const std::unique_ptr<sqlite3_stmt, decltype(&sqlite3_finalize)> rows(prepared, &sqlite3_finalize);
  while (sqlite3_step(prepared) == SQLITE_ROW) {
    const std::string key = Hex(sqlite3_column_blob(prepared, 0), sqlite3_column_bytes(prepared, 0));
    ASSIGN_OR_RETURN(const storage::Provenance made, storage::ReadProvenance(state / "artifacts" / key.substr(0, 2) / (key + ".h5")));
    Stage& stage = run.stages[made.kind];
    ++stage.tasks;
    stage.megabytes += 1e-6 * static_cast<double>(sqlite3_column_int64(prepared, 1));
    stage.cpu_s += sqlite3_column_double(prepared, 2);
    stage.peak_mib = std::max(stage.peak_mib, static_cast<double>(sqlite3_column_int64(prepared, 3)) / (1 << 20));
    run.cpu_s += sqlite3_column_double(prepared, 2);
    run.peak_mib = std::max(run.peak_mib, stage.peak_mib);
  }
  return absl::OkStatus();
}

absl::Status Score(const std::filesystem::path& tracked, const std::filesystem::path& truth_path, TakeRun& run) {
  ASSIGN_OR_RETURN(const geometry::TrackedTake take, storage::ReadTrackedTake(tracked));
  ASSIGN_OR_RETURN(const storage::Truth truth, storage::ReadTruth(truth_path));
  const std::vector<geometry::Vec3>& rest = truth.points[static_cast<std::size_t>(take.model.frame)];
  const std::vector<geometry::Vec3> carried = tracking::CarryPoints(take, rest);
  std::vector<double> errors;
  for (std::size_t f = 0; f < take.frame_count(); ++f) {
    const auto& there = truth.points[static_cast<std::size_t>(take.patches.frames[f])];
    for (std::size_t i = 0; i < rest.size(); ++i) errors.push_back(1000 * (carried[f * rest.size() + i] - there[i]).norm());
  }
  std::ranges::sort(errors);
  run.mean_mm = std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(errors.size());
  run.p95_mm = errors[errors.size() * 95 / 100];
  return absl::OkStatus();
}

/// Makes the capture, runs the job on it, and looks at what it cost.
absl::StatusOr<TakeRun> RunTake(const TakeSize& size) {
  const ScratchFolder scratch;
  const std::filesystem::path capture = scratch.path() / "capture";
  const std::filesystem::path state = scratch.path() / "state";
  const std::filesystem::path out = scratch.path() / "out";
  RETURN_IF_ERROR(MakeCapture(size, capture));
  const std::string program = std::filesystem::read_symlink("/proc/self/exe").parent_path() / "vorocast";
  TakeRun run;
  ASSIGN_OR_RETURN(run.wall_s, SecondsOf({program, "run", capture, "--cells", std::to_string(size.cells), "--patches", std::to_string(size.patches),
                                          "--template", "0", "--no-sheets", "--workers", "2", "--state", state, "--out", out},
                                         scratch.path() / "run.log"));
  RETURN_IF_ERROR(ReadStages(state, run));
  RETURN_IF_ERROR(Score(out / "tracked.h5", capture / "truth.h5", run));
  return run;
}

constexpr const char* kKinds[] = {"tessellate", "template", "stretch", "guide", "track", "assemble"};

void PrintStages(const TakeRun& run) {
  fmt::print("| stage | tasks | CPU s | CPU s a task | peak MiB | MB stored |\n|---|---|---|---|---|---|\n");
  for (const char* kind : kKinds) {
    const auto found = run.stages.find(kind);
    if (found == run.stages.end()) continue;
    const Stage& stage = found->second;
    fmt::print("| {} | {} | {:.2f} | {:.3f} | {:.0f} | {:.1f} |\n", kind, stage.tasks, stage.cpu_s, stage.cpu_s / stage.tasks, stage.peak_mib,
               stage.megabytes);
  }
  fmt::print("\n");
}

absl::Status RunOne(BenchReport& report, const TakeSize& size) {
  ASSIGN_OR_RETURN(const TakeRun run, RunTake(size));
  PrintStages(run);
  report.Add({.name = fmt::format("take-{}", size.frames),
              .cpu_s = run.cpu_s,
              .quality = {{"wall_s", run.wall_s}, {"peak_mib", run.peak_mib}, {"mean_mm", run.mean_mm}, {"p95_mm", run.p95_mm}},
              .goal = {{"wall_s", kGoalWall * size.frames / 126}, {"cpu_s", kGoalCpu * size.frames / 126}, {"peak_mib", kGoalMiB}}});
  return absl::OkStatus();
}

/// One size is changed at a time from a take of 6 frames, 16k points, 1000 cells, 50 patches.
absl::Status PrintGrowth() {
  const TakeSize base{.frames = 6, .points = 16'000, .cells = 1000, .patches = 50};
  std::vector<std::pair<std::string, TakeSize>> rows{{"16k points, 1k cells, 50 patches, 6 frames", base}};
  const auto add = [&](const std::string& name, auto TakeSize::*field, std::int32_t value) {
    rows.emplace_back(name, base);
    rows.back().second.*field = value;
  };
  add("65k points", &TakeSize::points, 65'000);
  add("260k points", &TakeSize::points, 260'000);
  add("5k cells", &TakeSize::cells, 5000);
  add("20k cells", &TakeSize::cells, 20'000);
  add("200 patches", &TakeSize::patches, 200);
  add("800 patches", &TakeSize::patches, 800);
  add("30 frames", &TakeSize::frames, 30);
  fmt::print("| | cells, s a frame | template s | guide s | window s | assembly s | peak MiB | MB a frame |\n|---|---|---|---|---|---|---|---|\n");
  for (const auto& [name, size] : rows) {
    ASSIGN_OR_RETURN(const TakeRun run, RunTake(size));
    const auto each = [&](const char* kind) {
      const auto found = run.stages.find(kind);
      return found == run.stages.end() ? 0.0 : found->second.cpu_s / found->second.tasks;
    };
    double megabytes = 0;
    for (const auto& [kind, stage] : run.stages) megabytes += stage.megabytes;
    fmt::print("| {} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.0f} | {:.1f} |\n", name, each("tessellate"), each("template"), each("guide"),
               each("track"), each("assemble"), run.peak_mib, megabytes / size.frames);
    std::fflush(stdout);
  }
  return absl::OkStatus();
}

absl::Status Run(BenchReport& report) {
  TakeSize size;
  const std::vector<std::string>& arguments = report.arguments();
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (arguments[i] == "--growth") return PrintGrowth();
    if (i + 1 == arguments.size()) break;
    const std::int32_t value = std::max(1, std::atoi(arguments[i + 1].c_str()));
    if (arguments[i] == "--frames") size.frames = value;
    if (arguments[i] == "--points") size.points = value;
    if (arguments[i] == "--cells") size.cells = value;
    if (arguments[i] == "--patches") size.patches = value;
  }
  return RunOne(report, size);
}

}  // namespace
}  // namespace vorocast::bench

int main(int argc, char** argv) { return vorocast::bench::RunBench("bench_take", argc, argv, vorocast::bench::Run); }
