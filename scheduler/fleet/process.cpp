// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/fleet/process.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <sstream>

#include <fmt/format.h>
#include "services/base/spawn_attributes.h"

namespace vorocast::fleet {
namespace {

/// 0 when there is no such process, or it has ended and only waits to be reaped by somebody else.
std::uint64_t StartTime(pid_t pid) {
  std::ifstream file(fmt::format("/proc/{}/stat", pid));
  std::string line;
  if (!std::getline(file, line)) return 0;
  // The second field is the program's name in brackets and may hold anything; the third is the state.
  std::istringstream rest(line.substr(std::min(line.size(), line.rfind(')') + 1)));
  std::string field;
  for (int number = 3; number < 22 && rest >> field; ++number) {
    if (number == 3 && (field == "Z" || field == "X")) return 0;
  }
  std::uint64_t start = 0;
  return rest >> start ? start : 0;
}

}  // namespace

absl::StatusOr<ProcessId> StartProcess(const std::vector<std::string>& arguments, const std::filesystem::path& log) {
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
  posix_spawn_file_actions_adddup2(&files, STDOUT_FILENO, STDERR_FILENO);
  const base::SpawnAttributes attributes;
  ProcessId process;
  const int result = posix_spawn(&process.pid, argv[0], &files, attributes.get(), argv.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  if (result != 0) return absl::UnavailableError(fmt::format("{}: cannot be started: {}", arguments[0], std::strerror(result)));
  process.start_time = StartTime(process.pid);
  return process;
}

bool IsAlive(const ProcessId& process) {
  if (process.pid <= 0) return false;
  waitpid(process.pid, nullptr, WNOHANG);
  const std::uint64_t start = StartTime(process.pid);
  return start != 0 && start == process.start_time;
}

void Signal(const ProcessId& process, int signal) {
  if (IsAlive(process)) kill(-process.pid, signal);
}

}  // namespace vorocast::fleet
