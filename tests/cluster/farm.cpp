// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/cluster/farm.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <fmt/format.h>

#include "services/base/check.h"
#include "tests/cluster/small_job.h"

namespace vorocast::cluster {

int FreePort() {
  const int socket_file = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
  socklen_t size = sizeof address;
  VOROCAST_CHECK(bind(socket_file, reinterpret_cast<sockaddr*>(&address), size) == 0);
  VOROCAST_CHECK(getsockname(socket_file, reinterpret_cast<sockaddr*>(&address), &size) == 0);
  close(socket_file);
  return ntohs(address.sin_port);
}

Farm::Farm(const Options& options) : options_(options) {
  std::filesystem::create_directories(state());
  for (int i = 0; i < options.schedulers; ++i) addresses_.push_back(fmt::format("127.0.0.1:{}", FreePort()));
  for (const std::string& name : names()) {
    members_[name] = Start(name);
    const bool ready = name != "scheduler-0" || Eventually([&] { return Leads(0); }, 30);
    EXPECT_TRUE(ready) << "the first scheduler does not lead";
  }
}

std::string Farm::address() const { return fmt::format("{}", fmt::join(addresses_, ",")); }

std::vector<std::string> Farm::names() const {
  std::vector<std::string> names;
  for (int i = 0; i < options_.schedulers; ++i) names.push_back(fmt::format("scheduler-{}", i));
  for (int i = 0; i < options_.workers; ++i) names.push_back(fmt::format("worker-{}", i));
  names.push_back("simulation");
  return names;
}

bool Farm::Leads(int scheduler) { return SchedulerPid(state()) == member(fmt::format("scheduler-{}", scheduler)).pid(); }

void Farm::Revive() {
  for (auto& [name, process] : members_) {
    if (process->HasEnded()) process = Start(name);
  }
}

std::vector<std::string> Farm::SubmitArguments(const std::filesystem::path& capture, const std::vector<std::string>& more) const {
  std::vector<std::string> arguments = {"submit", capture.string(), "--to", address()};
  const std::vector<std::string> job = SmallJobFlags();
  arguments.insert(arguments.end(), job.begin(), job.end());
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

std::map<std::string, std::string> Farm::FetchedDigests() const {
  std::filesystem::remove_all(out());
  const Outcome fetched = RunProgram({"fetch", "--to", address(), "--out", out().string()});
  EXPECT_EQ(fetched.exit_code, 0) << fetched.output;
  return Digests(out());
}

std::unique_ptr<Running> Farm::Start(const std::string& name) const {
  if (name.starts_with("worker")) return std::make_unique<Running>(std::vector<std::string>{"--scheduler", address()}, "vorocast-worker");
  if (name == "simulation") return std::make_unique<Running>(std::vector<std::string>{"--scheduler", address()}, "vorocast-simulation");
  std::vector<std::string> arguments = {"--state", state().string(), "--listen", addresses_[name == "scheduler-0" ? 0 : 1]};
  if (!options_.database.empty()) arguments.insert(arguments.end(), {"--database", options_.database});
  return std::make_unique<Running>(arguments, "vorocast-scheduler");
}

}  // namespace vorocast::cluster
