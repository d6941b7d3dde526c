// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/support/temporary_postgres.h"

#include <fcntl.h>
#include <grp.h>
#include <libpq-fe.h>
#include <pwd.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

#include <fmt/format.h>

#include "services/base/check.h"

namespace vorocast::support {
namespace {

namespace fs = std::filesystem;

constexpr auto kStartDeadline = std::chrono::seconds(30);

/// Debian keeps them out of the PATH, one folder a version.
fs::path Programs() {
  std::error_code error;
  fs::path newest;
  for (const auto& version : fs::directory_iterator("/usr/lib/postgresql", error)) {
    if (fs::exists(version.path() / "bin" / "initdb") && version.path() > newest) newest = version.path();
  }
  return newest.empty() ? newest : newest / "bin";
}

const passwd& OtherUser() {
  const passwd* user = getpwnam("postgres");
  if (!user) user = getpwnam("nobody");
  VOROCAST_CHECK(user);
  return *user;
}

/// The kernel tells of a process's parent only: as the second word after its name, which stands in brackets and may hold anything.
std::vector<pid_t> ChildrenOf(pid_t parent) {
  std::vector<pid_t> children;
  for (const auto& process : fs::directory_iterator("/proc")) {
    const pid_t pid = std::atoi(process.path().filename().c_str());
    if (pid <= 0) continue;
    std::ifstream file(process.path() / "stat");
    std::string line;
    std::getline(file, line);  // empty if the process has just ended
    const std::size_t name_end = line.rfind(')');
    if (name_end == std::string::npos) continue;
    std::istringstream rest(line.substr(name_end + 1));
    std::string state;
    pid_t of = 0;
    if (rest >> state >> of && of == parent) children.push_back(pid);
  }
  return children;
}

struct Finish {
  void operator()(PGconn* connection) const { PQfinish(connection); }
};

}  // namespace

std::unique_ptr<TemporaryPostgres> TemporaryPostgres::Start(bool durable) {
  const fs::path programs = Programs();
  if (programs.empty()) return nullptr;
  return std::unique_ptr<TemporaryPostgres>(new TemporaryPostgres(programs, durable));
}

TemporaryPostgres::TemporaryPostgres(fs::path programs, bool durable) : programs_(std::move(programs)), durable_(durable) {
  std::string pattern = (fs::temp_directory_path() / "vorocast-postgres-XXXXXX").string();
  VOROCAST_CHECK(mkdtemp(pattern.data()) != nullptr);
  folder_ = pattern;
  if (geteuid() == 0) VOROCAST_CHECK(chown(pattern.c_str(), OtherUser().pw_uid, OtherUser().pw_gid) == 0);
  const pid_t initdb =
      Launch("initdb", {"-D", (folder_ / "data").string(), "-U", "vorocast", "-A", "trust", "-E", "UTF8", "--locale=C", "--no-sync"});
  int status = 0;
  VOROCAST_CHECK(waitpid(initdb, &status, 0) == initdb && WIFEXITED(status) && WEXITSTATUS(status) == 0);
  Restart();
}

TemporaryPostgres::~TemporaryPostgres() {
  if (pid_ > 0) {
    kill(pid_, SIGINT);  // ends the sessions, then itself
    waitpid(pid_, nullptr, 0);
  }
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

pid_t TemporaryPostgres::Launch(const std::string& program, const std::vector<std::string>& arguments) const {
  const std::string path = (programs_ / program).string();
  const std::string log = (folder_ / "log.txt").string();
  std::vector<char*> argv = {const_cast<char*>(path.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  const passwd* const user = geteuid() == 0 ? &OtherUser() : nullptr;
  const pid_t pid = fork();
  VOROCAST_CHECK(pid >= 0);
  if (pid > 0) return pid;
  if (user && (setgroups(0, nullptr) != 0 || setgid(user->pw_gid) != 0 || setuid(user->pw_uid) != 0)) _exit(126);
  prctl(PR_SET_PDEATHSIG, SIGQUIT);  // should the test crash
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  if (chdir(folder_.c_str()) != 0) _exit(126);
  const int output = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
  dup2(output, STDOUT_FILENO);
  dup2(output, STDERR_FILENO);
  execv(path.c_str(), argv.data());
  _exit(127);
}

std::string TemporaryPostgres::Url(const std::string& name) const {
  const std::string url = fmt::format("postgresql://vorocast@/postgres?host={}", folder_.string());
  const std::unique_ptr<PGconn, Finish> connection(PQconnectdb(url.c_str()));
  PQclear(PQexec(connection.get(), fmt::format("SET client_min_messages = error; CREATE SCHEMA IF NOT EXISTS {}", name).c_str()));
  return fmt::format("{}&options=-csearch_path%3D{}", url, name);
}

bool TemporaryPostgres::Answers() const {
  return PQping(fmt::format("postgresql://vorocast@/postgres?host={}", folder_.string()).c_str()) == PQPING_OK;
}

void TemporaryPostgres::Kill() {
  kill(pid_, SIGSTOP);  // so that it makes no further children
  const std::vector<pid_t> sessions = ChildrenOf(pid_);
  kill(pid_, SIGKILL);
  for (const pid_t session : sessions) kill(session, SIGKILL);
  waitpid(pid_, nullptr, 0);
  pid_ = -1;
}

void TemporaryPostgres::Restart() {
  const auto deadline = std::chrono::steady_clock::now() + kStartDeadline;
  while (std::chrono::steady_clock::now() < deadline) {
    // Until the last of a killed server's processes has ended, a new one refuses to start.
    if (pid_ < 0 || waitpid(pid_, nullptr, WNOHANG) == pid_) {
      pid_ = Launch("postgres", {"-D", (folder_ / "data").string(), "-k", folder_.string(), "-c", "listen_addresses=", "-c", "shared_buffers=64MB",
                                 "-c", fmt::format("fsync={}", durable_ ? "on" : "off"), "-c", "max_wal_size=2GB"});
    }
    if (Answers()) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  VOROCAST_CHECK(false && "PostgreSQL did not start; its log is log.txt in the temporary folder");
}

}  // namespace vorocast::support
