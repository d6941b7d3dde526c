// SPDX-License-Identifier: AGPL-3.0-or-later
#include "scheduler/fleet/command.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>

#include <fmt/format.h>

#include "absl/time/clock.h"
#include "services/base/spawn_attributes.h"

namespace vorocast::fleet {
namespace {

constexpr std::size_t kErrorBytes = 2000;
/// The rest stays here: passwords of a database have no business in a cluster's job records.
constexpr std::string_view kPassedOn[] = {
    "PATH=", "HOME=", "USER=", "LOGNAME=", "LANG=", "LC_ALL=", "TZ=", "TMPDIR=", "SLURM_CONF=", "XDG_RUNTIME_DIR=", "LD_LIBRARY_PATH="};

std::vector<char*> Environment() {
  std::vector<char*> kept;
  for (char** variable = environ; *variable; ++variable) {
    const std::string_view text = *variable;
    if (std::any_of(std::begin(kPassedOn), std::end(kPassedOn), [&](std::string_view name) { return text.starts_with(name); }))
      kept.push_back(*variable);
  }
  kept.push_back(nullptr);
  return kept;
}

/// Both ends close themselves.
struct Pipe {
  int ends[2] = {-1, -1};
  Pipe() {
    if (pipe2(ends, O_CLOEXEC) != 0) ends[0] = ends[1] = -1;
  }
  ~Pipe() {
    Close(0);
    Close(1);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  void Close(int which) {
    if (ends[which] >= 0) close(ends[which]);
    ends[which] = -1;
  }
};

class Child {
 public:
  absl::Status Start(const std::vector<std::string>& arguments) {
    if (out_.ends[0] < 0 || error_.ends[0] < 0)
      return absl::UnavailableError(fmt::format("{}: no more pipes: {}", arguments[0], std::strerror(errno)));
    std::vector<char*> argv;
    for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&files, out_.ends[1], STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&files, error_.ends[1], STDERR_FILENO);
    const base::SpawnAttributes attributes;
    const int result = posix_spawnp(&pid_, argv[0], &files, attributes.get(), argv.data(), Environment().data());
    posix_spawn_file_actions_destroy(&files);
    out_.Close(1);
    error_.Close(1);
    if (result == 0) return absl::OkStatus();
    pid_ = -1;
    return absl::UnavailableError(fmt::format("{}: cannot be started: {}", arguments[0], std::strerror(result)));
  }
  ~Child() { (void)Wait(absl::InfinitePast()); }

  /// Until both streams have ended.
  absl::Status Read(const CommandLimits& limits, absl::Time deadline) {
    while (out_.ends[0] >= 0 || error_.ends[0] >= 0) {
      const absl::Duration left = deadline - absl::Now();
      if (left <= absl::ZeroDuration()) return absl::UnavailableError(fmt::format("no answer within {}", absl::FormatDuration(limits.time)));
      pollfd polled[2] = {{out_.ends[0], POLLIN, 0}, {error_.ends[0], POLLIN, 0}};
      if (poll(polled, 2, static_cast<int>(std::min<std::int64_t>(absl::ToInt64Milliseconds(left) + 1, 1000))) < 0 && errno != EINTR) {
        return absl::UnavailableError(fmt::format("cannot be read: {}", std::strerror(errno)));
      }
      if (polled[0].revents) ReadSome(out_, out);
      if (polled[1].revents) ReadSome(error_, error);
      if (out.size() > limits.output_bytes) return absl::ResourceExhaustedError(fmt::format("printed more than {} bytes", limits.output_bytes));
      if (error.size() > kErrorBytes) error.resize(kErrorBytes);
    }
    return absl::OkStatus();
  }

  /// The status that waitpid gives; killed first if it has not ended by then.
  int Wait(absl::Time deadline) {
    int status = -1;
    if (pid_ <= 0) return status;
    while (waitpid(pid_, &status, WNOHANG) == 0) {
      if (absl::Now() >= deadline) kill(-pid_, SIGKILL);
      absl::SleepFor(absl::Milliseconds(2));
    }
    pid_ = -1;
    return status;
  }

  std::string out, error;

 private:
  static void ReadSome(Pipe& pipe, std::string& text) {
    char bytes[65536];
    const ssize_t count = read(pipe.ends[0], bytes, sizeof bytes);
    if (count > 0) {
      text.append(bytes, static_cast<std::size_t>(count));
    } else if (count == 0 || errno != EINTR) {
      pipe.Close(0);
    }
  }

  Pipe out_, error_;
  pid_t pid_ = -1;
};

std::string OneLine(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 32; }, ' ');
  return text;
}

}  // namespace

absl::StatusOr<std::string> RunCommand(const std::vector<std::string>& arguments, const CommandLimits& limits) {
  const absl::Time deadline = absl::Now() + limits.time;
  Child child;
  RETURN_IF_ERROR(child.Start(arguments));
  if (const absl::Status read = child.Read(limits, deadline); !read.ok()) return base::Annotate(read, arguments[0]);
  const int status = child.Wait(deadline);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return std::move(child.out);
  const std::string how = WIFEXITED(status) ? fmt::format("code {}", WEXITSTATUS(status)) : fmt::format("signal {}", WTERMSIG(status));
  return absl::UnavailableError(fmt::format("{}: ended with {}: {}", arguments[0], how, OneLine(std::move(child.error))));
}

}  // namespace vorocast::fleet
