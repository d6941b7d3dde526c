// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/cluster/programs.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "services/base/check.h"
#include "services/base/digest.h"

namespace vorocast::cluster {
namespace {

namespace fs = std::filesystem;

constexpr double kWaitSeconds = 300;

struct ScratchFolder {
  fs::path path;
  ScratchFolder() {
    std::string pattern = (fs::temp_directory_path() / "vorocast-cluster-XXXXXX").string();
    VOROCAST_CHECK(mkdtemp(pattern.data()) != nullptr);
    path = pattern;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    if (!std::getenv("VOROCAST_KEEP")) fs::remove_all(path, ignored);
  }
};

std::string ReadText(const fs::path& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

}  // namespace

const fs::path& Scratch() {
  static const ScratchFolder folder;
  return folder.path;
}

Running::Running(const std::vector<std::string>& arguments, const std::string& name) {
  static int count = 0;
  log_ = Scratch() / fmt::format("output-{}.txt", count++);
  const std::string program = (fs::path(VOROCAST_PROGRAMS) / name).string();
  std::vector<char*> argv = {const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_ = fork();
  VOROCAST_CHECK(pid_ >= 0);
  if (pid_ == 0) {
    const int log = open(log_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    dup2(log, STDOUT_FILENO);
    dup2(log, STDERR_FILENO);
    execv(program.c_str(), argv.data());
    _exit(127);
  }
}

Running::~Running() {
  if (pid_ <= 0) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
}

void Running::Signal(int signal_number) const {
  if (pid_ > 0) kill(pid_, signal_number);
}

bool Running::HasEnded() {
  if (pid_ > 0 && waitpid(pid_, &status_, WNOHANG) == pid_) pid_ = -1;
  return pid_ <= 0;
}

Outcome Running::Wait() {
  const bool ended = Eventually([&] { return HasEnded(); }, kWaitSeconds);
  Outcome outcome;
  outcome.output = ReadText(log_);
  if (!ended) {
    ADD_FAILURE() << "still running after five minutes:\n" << outcome.output;
    return outcome;
  }
  if (WIFEXITED(status_)) outcome.exit_code = WEXITSTATUS(status_);
  return outcome;
}

Outcome RunProgram(const std::vector<std::string>& arguments) { return Running(arguments).Wait(); }

bool Eventually(const std::function<bool()>& condition, double seconds) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < deadline) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return condition();
}

std::map<std::string, std::string> Digests(const fs::path& folder) {
  std::map<std::string, std::string> digests;
  if (!fs::exists(folder)) return digests;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    // XDMF names the files it describes by their absolute paths.
    if (!entry.is_regular_file() || entry.path().extension() == ".xdmf") continue;
    const auto digest = base::HashFile(entry.path());
    digests[fs::relative(entry.path(), folder).generic_string()] = digest.ok() ? digest->Hex() : std::string(digest.status().message());
  }
  return digests;
}

std::size_t CountFiles(const fs::path& folder) {
  std::error_code error;
  std::size_t count = 0;
  for (auto it = fs::recursive_directory_iterator(folder, error); !error && it != fs::recursive_directory_iterator(); it.increment(error)) {
    if (it->is_regular_file(error)) ++count;
  }
  return count;
}

std::map<std::string, int> FinishedTasks(const fs::path& state) {
  std::map<std::string, int> finished;
  for (const auto& entry : fs::directory_iterator(state / "logs")) {
    std::ifstream log(entry.path());
    for (std::string line; std::getline(log, line);) {
      // "TIME info attempt done: task="LABEL" attempt=12 …"
      constexpr std::string_view kDone = "attempt done: task=\"";
      const std::size_t start = line.find(kDone);
      if (start == std::string::npos) continue;
      const std::size_t label = start + kDone.size();
      ++finished[line.substr(label, line.find('"', label) - label)];
    }
  }
  return finished;
}

pid_t SchedulerPid(const fs::path& state) {
  const auto json = nlohmann::json::parse(ReadText(state / "scheduler.json"), nullptr, false);
  return json.is_object() ? json.value("pid", -1) : -1;
}

pid_t MemberPid(const fs::path& state, const std::string& name) {
  const auto json = nlohmann::json::parse(ReadText(state / "fleet.json"), nullptr, false);
  if (!json.is_array()) return -1;
  for (const auto& member : json) {
    if (member.value("name", "") == name) return member.value("pid", -1);
  }
  return -1;
}

pid_t ChildOf(pid_t pid) {
  if (pid <= 0) return -1;
  for (const auto& task : fs::directory_iterator(fmt::format("/proc/{}/task", pid), fs::directory_options::skip_permission_denied)) {
    std::ifstream children(task.path() / "children");
    pid_t child = -1;
    if (children >> child) return child;
  }
  return -1;
}

bool Alive(pid_t pid) { return pid > 0 && kill(pid, 0) == 0; }

}  // namespace vorocast::cluster
