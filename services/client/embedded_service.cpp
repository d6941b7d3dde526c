// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/embedded_service.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <optional>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "services/client/programs.h"

namespace vorocast::client {
namespace {

constexpr auto kStartDeadline = std::chrono::seconds(20);
constexpr auto kStopDeadline = std::chrono::seconds(20);
constexpr auto kPollInterval = std::chrono::milliseconds(20);

/// What the scheduler says of itself in STATE/scheduler.json once it serves.
struct Announcement {
  std::string address;
  pid_t pid = 0;
};

std::optional<Announcement> ReadAnnouncement(const std::filesystem::path& state) {
  std::ifstream file(state / "scheduler.json");
  if (!file) return std::nullopt;
  const auto json = nlohmann::json::parse(file, nullptr, false);
  if (!json.is_object() || !json.contains("address") || !json["address"].is_string() || !json.contains("pid") || !json["pid"].is_number_integer())
    return std::nullopt;
  return Announcement{json["address"].get<std::string>(), json["pid"].get<pid_t>()};
}

bool IsScheduler(pid_t pid) {
  std::error_code error;
  const auto program = std::filesystem::read_symlink(fmt::format("/proc/{}/exe", pid), error);
  return !error && program.filename().string().starts_with("vorocast-scheduler");
}

std::string LastLines(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::string line;
  std::vector<std::string> lines;
  while (std::getline(file, line)) {
    lines.push_back(line);
    if (lines.size() > 5) lines.erase(lines.begin());
  }
  return fmt::format("{}", fmt::join(lines, "\n"));
}

}  // namespace

std::filesystem::path DefaultStateFolder() {
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache && *cache) return std::filesystem::path(cache) / "vorocast";
  if (const char* home = std::getenv("HOME"); home && *home) return std::filesystem::path(home) / ".cache" / "vorocast";
  return std::filesystem::temp_directory_path() / "vorocast";
}

absl::StatusOr<std::string> RunningSchedulerAddress(const std::filesystem::path& state) {
  const auto announcement = ReadAnnouncement(state);
  if (!announcement || !IsScheduler(announcement->pid)) {
    return absl::NotFoundError(fmt::format("no scheduler serves {}: start one with 'vorocast serve --state {}', or name one with --to HOST:PORT",
                                           state.string(), state.string()));
  }
  return announcement->address;
}

struct EmbeddedService::Process {
  EmbeddedServiceOptions options;
  std::string address;
  pid_t child = -1;  // −1 while another process's scheduler is used

  absl::Status Launch();
  absl::Status AwaitAnnouncement();
  bool ChildIsAlive();
  void Stop();
};

absl::Status EmbeddedService::Process::Launch() {
  ASSIGN_OR_RETURN(const std::filesystem::path program, ProgramBeside("vorocast-scheduler"));
  const std::filesystem::path log = options.state / "logs" / "scheduler.stderr";
  std::error_code error;
  std::filesystem::create_directories(log.parent_path(), error);
  if (error)
    return absl::UnavailableError(
        fmt::format("{}: cannot be created: {}; choose another folder with --state", log.parent_path().string(), error.message()));
  const std::int32_t workers = options.workers > 0 ? options.workers : static_cast<std::int32_t>(std::max(1u, std::thread::hardware_concurrency()));
  const std::vector<std::string> arguments = {program.string(),        "--state",     options.state.string(), "--workers",
                                              std::to_string(workers), "--simulation"};

  std::vector<char*> argv;  // made before the fork: between fork and exec nothing may take memory
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);

  const pid_t parent = getpid();
  child = fork();
  if (child < 0) return absl::ResourceExhaustedError(fmt::format("cannot start {}: {}", program.string(), std::strerror(errno)));
  if (child == 0) {
    // A group of its own: Ctrl-C reaches this client only, which then stops the service in good order. Should the client be killed,
    // the kernel tells the scheduler.
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != parent) _exit(1);
    const int output = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
    const int nothing = open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (output >= 0) dup2(output, STDOUT_FILENO), dup2(output, STDERR_FILENO);
    if (nothing >= 0) dup2(nothing, STDIN_FILENO);
    execv(program.c_str(), argv.data());
    _exit(127);
  }
  return AwaitAnnouncement();
}

absl::Status EmbeddedService::Process::AwaitAnnouncement() {
  const auto deadline = std::chrono::steady_clock::now() + kStartDeadline;
  while (std::chrono::steady_clock::now() < deadline) {
    const auto announcement = ReadAnnouncement(options.state);
    if (announcement && announcement->pid == child) {
      address = announcement->address;
      return absl::OkStatus();
    }
    if (!ChildIsAlive()) {
      // Another client may have been quicker to start a scheduler on this folder.
      if (auto other = RunningSchedulerAddress(options.state); other.ok()) {
        address = *other;
        return absl::OkStatus();
      }
      return absl::UnavailableError(fmt::format("the scheduler did not start; the end of {}:\n{}",
                                                (options.state / "logs" / "scheduler.stderr").string(),
                                                LastLines(options.state / "logs" / "scheduler.stderr")));
    }
    std::this_thread::sleep_for(kPollInterval);
  }
  Stop();
  return absl::DeadlineExceededError(
      fmt::format("the scheduler did not start within 20 s; its log is {}", (options.state / "logs" / "scheduler.stderr").string()));
}

bool EmbeddedService::Process::ChildIsAlive() {
  if (child <= 0) return false;
  if (waitpid(child, nullptr, WNOHANG) == 0) return true;
  child = -1;
  return false;
}

void EmbeddedService::Process::Stop() {
  if (!ChildIsAlive()) return;
  kill(child, SIGTERM);
  const auto deadline = std::chrono::steady_clock::now() + kStopDeadline;
  while (std::chrono::steady_clock::now() < deadline) {
    if (!ChildIsAlive()) return;
    std::this_thread::sleep_for(kPollInterval);
  }
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  child = -1;
}

EmbeddedService::EmbeddedService(std::unique_ptr<Process> process) : process_(std::move(process)) {}
EmbeddedService::EmbeddedService(EmbeddedService&&) noexcept = default;
EmbeddedService& EmbeddedService::operator=(EmbeddedService&&) noexcept = default;
EmbeddedService::~EmbeddedService() {
  if (process_) process_->Stop();
}

absl::StatusOr<EmbeddedService> EmbeddedService::Start(const EmbeddedServiceOptions& options) {
  auto process = std::make_unique<Process>();
  process->options = options;
  process->options.state = std::filesystem::absolute(options.state).lexically_normal();
  EmbeddedService service(std::move(process));
  RETURN_IF_ERROR(service.Ensure());
  return service;
}

const std::string& EmbeddedService::address() const { return process_->address; }

bool EmbeddedService::started_here() const { return process_->child > 0; }

absl::Status EmbeddedService::Ensure() {
  if (process_->ChildIsAlive()) return absl::OkStatus();
  if (auto running = RunningSchedulerAddress(process_->options.state); running.ok()) {
    process_->address = *running;
    return absl::OkStatus();
  }
  return process_->Launch();
}

}  // namespace vorocast::client
