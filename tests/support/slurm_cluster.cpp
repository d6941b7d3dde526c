// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/support/slurm_cluster.h"

#include <signal.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <fstream>

#include <fmt/format.h>

#include "services/base/check.h"

namespace vorocast::support {
namespace {

namespace fs = std::filesystem;

constexpr int kNotInstalled = 3;  // up.sh's exit code

std::string Script(const char* name) { return (fs::path(VOROCAST_SOURCE_DIR) / "deploy" / "slurm" / name).string(); }

/// The exit code. Its paths are this file's own, so a shell is good enough.
int Shell(const std::string& line) {
  const int status = std::system(line.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

bool IsZombie(pid_t pid) {
  std::ifstream file(fmt::format("/proc/{}/stat", pid));
  std::string stat;
  std::getline(file, stat);
  const std::size_t name_end = stat.rfind(')');
  return name_end == std::string::npos || stat.compare(name_end, 3, ") Z") == 0;
}

/// Away from the usual place and, as tests of several builds may run at once, from each other.
int FirstPort() { return 20000 + static_cast<int>(getpid() % 1000) * 10; }

}  // namespace

std::unique_ptr<SlurmCluster> SlurmCluster::Start(int nodes, int cpus_a_node) {
  std::string pattern = (fs::temp_directory_path() / "vorocast-slurm-XXXXXX").string();
  VOROCAST_CHECK(mkdtemp(pattern.data()) != nullptr);
  fs::permissions(pattern, fs::perms::group_exec | fs::perms::others_exec, fs::perm_options::add);
  std::unique_ptr<SlurmCluster> cluster(new SlurmCluster(pattern));
  const int code = Shell(fmt::format("'{}' '{}' {} {} {} >'{}/up.log' 2>&1", Script("up.sh"), pattern, nodes, cpus_a_node, FirstPort(), pattern));
  if (code == kNotInstalled) return nullptr;
  if (code != 0) Shell(fmt::format("cat '{}/up.log' '{}'/log/*", pattern, pattern));
  VOROCAST_CHECK(code == 0);
  setenv("SLURM_CONF", (cluster->folder_ / "slurm.conf").c_str(), 1);
  return cluster;
}

SlurmCluster::~SlurmCluster() {
  if (fs::exists(folder_ / "slurm.conf")) Shell(fmt::format("'{}' '{}' >/dev/null 2>&1", Script("down.sh"), folder_.string()));
  unsetenv("SLURM_CONF");
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

int SlurmCluster::Count(const std::string& state) const {
  FILE* pipe = popen(fmt::format("squeue --noheader --array --states={} --format=%i 2>/dev/null", state).c_str(), "r");
  VOROCAST_CHECK(pipe);
  int lines = 0;
  for (int c = getc(pipe); c != EOF; c = getc(pipe)) lines += c == '\n';
  pclose(pipe);
  return lines;
}

void SlurmCluster::KillNode(int node) const { Kill(fmt::format("slurmd-node{}.pid", node)); }

void SlurmCluster::KillController() const { Kill("slurmctld.pid"); }

void SlurmCluster::Kill(const std::string& pid_file) const {
  std::ifstream file(folder_ / pid_file);
  pid_t pid = -1;
  VOROCAST_CHECK(file >> pid && pid > 1);
  // Gone, or a zombie that nobody waits for: up.sh must not take it for running.
  while (kill(pid, SIGKILL) == 0 && !IsZombie(pid)) usleep(10'000);
}

void SlurmCluster::Repair() const {
  VOROCAST_CHECK(Shell(fmt::format("'{}' '{}' >>'{}/up.log' 2>&1", Script("up.sh"), folder_.string(), folder_.string())) == 0);
}

}  // namespace vorocast::support
