// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace vorocast::cluster {

struct Outcome {
  int exit_code = -1;  // −1: killed by a signal
  std::string output;  // standard output and error together
};

/// A running `vorocast …`, or another of the programs; killed when it goes out of scope.
class Running {
 public:
  explicit Running(const std::vector<std::string>& arguments, const std::string& program = "vorocast");
  ~Running();
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  void Signal(int signal_number) const;
  pid_t pid() const { return pid_; }
  /// Without waiting.
  bool HasEnded();
  /// Waits for its end, at most five minutes.
  Outcome Wait();

 private:
  pid_t pid_ = -1;  // −1: has ended
  int status_ = 0;  // then, as waitpid gives it
  std::filesystem::path log_;
};

Outcome RunProgram(const std::vector<std::string>& arguments);

/// Asks `condition` a hundred times a second for at most `seconds`; whether it came true.
bool Eventually(const std::function<bool()>& condition, double seconds = 120);

/// A folder for one test program, removed at its end.
const std::filesystem::path& Scratch();

/// Relative path and SHA-256 of every file below a folder that does not depend on where the folder is.
std::map<std::string, std::string> Digests(const std::filesystem::path& folder);

std::size_t CountFiles(const std::filesystem::path& folder);

/// How many times each task was finished, from the logs that the workers of a state folder keep.
std::map<std::string, int> FinishedTasks(const std::filesystem::path& state);

/// From STATE/scheduler.json and STATE/fleet.json; −1 if there is none.
pid_t SchedulerPid(const std::filesystem::path& state);
pid_t MemberPid(const std::filesystem::path& state, const std::string& name);
/// A child process that is working on a task of that member; −1 if there is none now.
pid_t ChildOf(pid_t pid);
bool Alive(pid_t pid);

}  // namespace vorocast::cluster
