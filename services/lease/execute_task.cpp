// SPDX-License-Identifier: AGPL-3.0-or-later
// The child's side: one task in a process of its own.
#include <malloc.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <exception>
#include <fstream>
#include <iterator>
#include <new>

#include <fmt/format.h>
#include "services/lease/child_task.h"
#include "services/lease/lease_loop.h"
#include "services/storage/hdf5_artifacts.h"

namespace vorocast::lease {
namespace {

constexpr auto kProgressInterval = std::chrono::milliseconds(200);
constexpr int kMalformedTask = 2;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kReservesAddressSpace = true;  // terabytes of shadow memory: no limit on the address space can be set
#else
constexpr bool kReservesAddressSpace = false;
#endif

std::string ReadAll(int fd) {
  std::string text;
  char block[64 << 10];
  for (;;) {
    const ssize_t count = ::read(fd, block, sizeof(block));
    if (count > 0) text.append(block, static_cast<std::size_t>(count));
    if (count == 0 || (count < 0 && errno != EINTR)) return text;
  }
}

void WriteLine(int fd, std::string line) {
  line.push_back('\n');
  for (std::string_view rest = line; !rest.empty();) {
    const ssize_t count = ::write(fd, rest.data(), rest.size());
    if (count < 0 && errno != EINTR) return;  // the worker is gone, and this process with it in a moment
    if (count > 0) rest.remove_prefix(static_cast<std::size_t>(count));
  }
}

/// Libraries that print to standard output must not be taken for this process's own lines. Returns where those go.
int SetStandardOutputAside() {
  const int lines = ::dup(STDOUT_FILENO);
  ::dup2(STDERR_FILENO, STDOUT_FILENO);
  return lines;
}

/// Limits what is taken from now on: the program's own mappings are not the task's doing.
void LimitMemory(std::int64_t limit) {
  if (limit <= 0 || kReservesAddressSpace) return;
  // Each arena reserves 64 MiB of address space, which would count against the task.
  ::mallopt(M_ARENA_MAX, 1);
  std::uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const rlim_t bytes = pages * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE)) + static_cast<rlim_t>(limit);
  const rlimit address_space{bytes, bytes};
  ::setrlimit(RLIMIT_AS, &address_space);
}

absl::Status OutOfMemory(std::int64_t limit) {
  return absl::ResourceExhaustedError(limit > 0 ? fmt::format("needs more memory than its limit of {} MiB", limit >> 20) : "out of memory");
}

/// Progress lines, at most one every kProgressInterval.
base::Progress ProgressTo(int fd) {
  return [fd, last = std::chrono::steady_clock::time_point()](double fraction) mutable {
    const auto now = std::chrono::steady_clock::now();
    if (!std::isfinite(fraction) || now - last < kProgressInterval) return;
    last = now;
    WriteLine(fd, EncodeProgress(fraction));
  };
}

absl::Status Run(const ChildTask& task, const std::vector<std::unique_ptr<Executor>>& executors, const base::Progress& progress) {
  ASSIGN_OR_RETURN(const storage::ArtifactStore store, storage::ArtifactStore::Open(task.store_root));
  for (const auto& executor : executors) {
    if (executor->kind() != task.spec.kind) continue;
    RETURN_IF_ERROR(executor->Execute(task.spec, store, task.output, progress));
    if (tasks::Extension(task.spec.kind) != ".h5") return absl::OkStatus();
    // What has just been written and cannot be read back is this program's or the disk's fault, not the input's.
    const absl::Status readable = storage::CheckArtifact(task.output);
    return readable.ok() ? readable : absl::InternalError(fmt::format("the result cannot be read back: {}", std::string(readable.message())));
  }
  return absl::InternalError(fmt::format("this program cannot run tasks of kind {}", tasks::Name(task.spec.kind)));
}

/// No exception leaves: whatever a library throws becomes the task's outcome.
absl::Status RunCaught(const ChildTask& task, const std::vector<std::unique_ptr<Executor>>& executors, const base::Progress& progress) {
  try {
    return Run(task, executors, progress);
  } catch (const std::bad_alloc&) {
    return OutOfMemory(task.memory_limit);
  } catch (const std::exception& exception) {
    return absl::InternalError(exception.what());
  }
}

}  // namespace

int ExecuteTaskMain(const std::vector<std::unique_ptr<Executor>>& executors) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  const int lines = SetStandardOutputAside();
  const absl::StatusOr<ChildTask> task = DecodeChildTask(ReadAll(STDIN_FILENO));
  if (!task.ok()) {
    WriteLine(lines, EncodeOutcome(task.status()));
    fmt::print(stderr, "{}\n", std::string(task.status().message()));
    return kMalformedTask;
  }
  // The worker may have died before the first line of this function.
  if (::getppid() != task->worker_pid) return kMalformedTask;
  LimitMemory(task->memory_limit);
  absl::Status outcome = RunCaught(*task, executors, ProgressTo(lines));
  if (absl::IsResourceExhausted(outcome) && outcome.message().empty()) outcome = OutOfMemory(task->memory_limit);
  WriteLine(lines, EncodeOutcome(outcome));
  return 0;
}

}  // namespace vorocast::lease
