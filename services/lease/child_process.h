// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/time/time.h"
#include "services/base/status.h"

namespace vorocast::lease {

/// A file descriptor that closes itself.
class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(int fd) : fd_(fd) {}
  ~FileDescriptor() { Close(); }
  FileDescriptor(FileDescriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    Close();
    fd_ = std::exchange(other.fd_, -1);
    return *this;
  }
  int get() const { return fd_; }
  bool open() const { return fd_ >= 0; }
  void Close();

 private:
  int fd_ = -1;
};

/// Lets any thread stop a child while another waits for it.
class StopFlag {
 public:
  StopFlag();
  void Stop();
  bool stopped() const;
  /// Readable once stopped.
  int fd() const { return event_.get(); }

 private:
  FileDescriptor event_;
};

struct ChildCommand {
  std::filesystem::path program;
  std::vector<std::string> arguments;
  std::string input;                                     // written to its standard input, then closed
  absl::Duration time_limit = absl::InfiniteDuration();  // wall clock; then it is killed
};

struct ChildEnd {
  enum class How : std::uint8_t { kExited, kSignalled, kTimedOut, kStopped };
  How how = How::kExited;
  int code = 0;                  // exit code, or the signal's number
  std::string printed;           // the last 64 KiB of its standard error
  double seconds = 0;            // wall clock
  double cpu_seconds = 0;        // user and system
  std::int64_t memory_peak = 0;  // bytes resident
};

/// Runs a program to its end in a process group of its own, with standard streams and no other descriptor open. `on_line` gets each whole line
/// of its standard output, in the calling thread, which must not end before the child: the child asks to be killed with it.
/// INTERNAL when it cannot be started.
absl::StatusOr<ChildEnd> RunChild(const ChildCommand& command, const StopFlag& stop, const std::function<void(std::string_view)>& on_line);

}  // namespace vorocast::lease
