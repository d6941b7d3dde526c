// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include "services/base/check.h"
#include "services/base/spawn_attributes.h"

namespace vorocast::lease {
namespace {

using SteadyTime = std::chrono::steady_clock::time_point;

constexpr std::size_t kPrintedBytes = 64 << 10;
constexpr std::size_t kLineBytesMax = 1 << 20;
/// How often the child is looked at while its pipes are silent, and after it has closed them.
constexpr int kQuietPollMs = 200;
constexpr int kClosedPollMs = 5;

struct Pipe {
  FileDescriptor read;
  FileDescriptor write;
};

absl::StatusOr<Pipe> MakePipe() {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) return absl::InternalError(fmt::format("no pipe for a child process: {}", std::strerror(errno)));
  return Pipe{FileDescriptor(ends[0]), FileDescriptor(ends[1])};
}

void MakeNonBlocking(const FileDescriptor& fd) { ::fcntl(fd.get(), F_SETFL, ::fcntl(fd.get(), F_GETFL) | O_NONBLOCK); }

/// Own process group, default signals, only the three standard streams.
absl::StatusOr<pid_t> Spawn(const ChildCommand& command, int input, int output, int error) {
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_adddup2(&files, input, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&files, output, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&files, error, STDERR_FILENO);
  posix_spawn_file_actions_addclosefrom_np(&files, STDERR_FILENO + 1);

  const base::SpawnAttributes attributes;
  std::vector<char*> arguments = {const_cast<char*>(command.program.c_str())};
  for (const std::string& argument : command.arguments) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  pid_t pid = 0;
  const int failure = ::posix_spawn(&pid, command.program.c_str(), &files, attributes.get(), arguments.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  if (failure != 0) return absl::InternalError(fmt::format("{}: cannot be started: {}", command.program.string(), std::strerror(failure)));
  return pid;
}

/// A running child, its pipes, and what came out of them.
class Child {
 public:
  Child(pid_t pid, FileDescriptor input, FileDescriptor output, FileDescriptor error, std::string_view to_write)
      : pid_(pid), input_(std::move(input)), output_(std::move(output)), error_(std::move(error)), to_write_(to_write) {
    for (const FileDescriptor* fd : {&input_, &output_, &error_}) MakeNonBlocking(*fd);
    if (to_write_.empty()) input_.Close();
  }

  void Kill() const { ::kill(-pid_, SIGKILL); }

  /// Waits until something happens or `timeout` has passed, and takes what came.
  void Poll(int stop_fd, int timeout_ms, const std::function<void(std::string_view)>& on_line) {
    std::array<pollfd, 4> polled = {pollfd{input_.get(), POLLOUT, 0}, pollfd{output_.get(), POLLIN, 0}, pollfd{error_.get(), POLLIN, 0},
                                    pollfd{stop_fd, POLLIN, 0}};
    if (!output_.open() && !error_.open()) timeout_ms = std::min(timeout_ms, kClosedPollMs);
    ::poll(polled.data(), polled.size(), timeout_ms);
    if (polled[0].revents != 0) WriteInput();
    if (polled[1].revents != 0) ReadOutput(on_line);
    if (polled[2].revents != 0) ReadError();
  }

  /// What is still in the pipes once the child has ended.
  void Drain(const std::function<void(std::string_view)>& on_line) {
    ReadOutput(on_line);
    ReadError();
  }

  /// The wait status, once it has ended.
  std::optional<int> Reap(rusage& usage) const {
    int status = 0;
    return ::wait4(pid_, &status, WNOHANG, &usage) == pid_ ? std::optional(status) : std::nullopt;
  }

  std::string TakePrinted() {
    if (printed_.size() > kPrintedBytes) printed_.erase(0, printed_.size() - kPrintedBytes);
    return std::move(printed_);
  }

 private:
  void WriteInput() {
    const ssize_t written = ::write(input_.get(), to_write_.data(), to_write_.size());
    if (written > 0) to_write_.remove_prefix(static_cast<std::size_t>(written));
    // A child that does not read is found out by how it ends.
    if ((written < 0 && errno != EAGAIN && errno != EINTR) || to_write_.empty()) input_.Close();
  }

  /// Takes what there is to read, a mebibyte at most so that a child that never stops writing does not hold the caller; closes the descriptor
  /// at its end.
  static void ReadInto(FileDescriptor& fd, const std::function<void(std::string_view)>& take) {
    std::array<char, 64 << 10> block;
    for (int blocks = 0; fd.open() && blocks < 16; ++blocks) {
      const ssize_t count = ::read(fd.get(), block.data(), block.size());
      if (count > 0) {
        take({block.data(), static_cast<std::size_t>(count)});
      } else if (count == 0 || (errno != EAGAIN && errno != EINTR)) {
        fd.Close();
      } else if (errno == EAGAIN) {
        return;
      }
    }
  }

  void ReadOutput(const std::function<void(std::string_view)>& on_line) {
    ReadInto(output_, [&](std::string_view bytes) {
      line_.append(bytes);
      std::size_t begin = 0;
      for (std::size_t end = line_.find('\n'); end != std::string::npos; end = line_.find('\n', begin)) {
        on_line(std::string_view(line_).substr(begin, end - begin));
        begin = end + 1;
      }
      line_.erase(0, begin);
      if (line_.size() > kLineBytesMax) line_.clear();
    });
  }

  void ReadError() {
    ReadInto(error_, [&](std::string_view bytes) {
      printed_.append(bytes);
      // Twice as much before anything is moved, so that a child that prints without end costs little.
      if (printed_.size() > 2 * kPrintedBytes) printed_.erase(0, printed_.size() - kPrintedBytes);
    });
  }

  pid_t pid_;
  FileDescriptor input_;
  FileDescriptor output_;
  FileDescriptor error_;
  std::string_view to_write_;
  std::string line_;
  std::string printed_;
};

double Seconds(const timeval& time) { return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec); }

int MillisecondsUntil(SteadyTime deadline, SteadyTime now) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - now).count();
  return static_cast<int>(std::clamp<std::int64_t>(left, 0, kQuietPollMs));
}

}  // namespace

void FileDescriptor::Close() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

StopFlag::StopFlag() : event_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) { VOROCAST_CHECK(event_.open()); }

void StopFlag::Stop() {
  const std::uint64_t one = 1;
  VOROCAST_CHECK(::write(event_.get(), &one, sizeof(one)) == sizeof(one));
}

bool StopFlag::stopped() const {
  pollfd polled{event_.get(), POLLIN, 0};
  return ::poll(&polled, 1, 0) > 0;
}

absl::StatusOr<ChildEnd> RunChild(const ChildCommand& command, const StopFlag& stop, const std::function<void(std::string_view)>& on_line) {
  ASSIGN_OR_RETURN(Pipe input, MakePipe());
  ASSIGN_OR_RETURN(Pipe output, MakePipe());
  ASSIGN_OR_RETURN(Pipe error, MakePipe());
  const SteadyTime start = std::chrono::steady_clock::now();
  ASSIGN_OR_RETURN(const pid_t pid, Spawn(command, input.read.get(), output.write.get(), error.write.get()));
  input.read.Close();
  output.write.Close();
  error.write.Close();
  Child child(pid, std::move(input.write), std::move(output.read), std::move(error.read), command.input);

  const bool has_limit = command.time_limit < absl::Hours(24 * 365);
  const SteadyTime deadline = has_limit ? start + absl::ToChronoMilliseconds(command.time_limit) : SteadyTime::max();
  ChildEnd end;
  bool killed = false;
  const auto kill_for = [&](ChildEnd::How how) {
    child.Kill();
    killed = true;
    end.how = how;
  };
  rusage usage{};
  std::optional<int> status;
  while (!(status = child.Reap(usage))) {
    const SteadyTime now = std::chrono::steady_clock::now();
    if (!killed && stop.stopped()) kill_for(ChildEnd::How::kStopped);
    if (!killed && now >= deadline) kill_for(ChildEnd::How::kTimedOut);
    // Once killed, the stop flag stays readable and would make the poll spin.
    child.Poll(killed ? -1 : stop.fd(), killed ? kClosedPollMs : MillisecondsUntil(deadline, now), on_line);
  }
  child.Drain(on_line);

  if (!killed) end.how = WIFSIGNALED(*status) ? ChildEnd::How::kSignalled : ChildEnd::How::kExited;
  end.code = WIFSIGNALED(*status) ? WTERMSIG(*status) : WEXITSTATUS(*status);
  end.printed = child.TakePrinted();
  end.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  end.cpu_seconds = Seconds(usage.ru_utime) + Seconds(usage.ru_stime);
  end.memory_peak = static_cast<std::int64_t>(usage.ru_maxrss) * 1024;
  return end;
}

}  // namespace vorocast::lease
