// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/fuzz/watchdog.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <vector>

#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/common_interface_defs.h>
#endif

namespace vorocast::fuzz {
namespace {

constexpr int kCpuSecondsMax = 10;
constexpr int kSecondsMax = 120;
/// Far more than any reader may need for a small input; without it a bad length would take the machine down before anything is noticed.
[[maybe_unused]] constexpr rlim_t kMemoryMax = rlim_t{4} << 30;

// Only what a signal handler may touch.
const char* current = nullptr;
std::size_t current_size = 0;
char path[4096];
char program[4096];

void Say(const char* text) { [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, text, std::strlen(text)); }

void KeepInput() {
  if (!current || !*path) return;
  const int file = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) return Say("the input could not be written\n");
  for (std::size_t at = 0; at < current_size;) {
    const ssize_t count = write(file, current + at, current_size - at);
    if (count <= 0) break;
    at += static_cast<std::size_t>(count);
  }
  close(file);
  Say("\nThe input is kept; to repeat:\n  ");
  Say(program);
  Say(" ");
  Say(path);
  Say("\n");
  current = nullptr;
}

void OnSignal(int number) {
  if (number == SIGPROF || number == SIGALRM) Say("\nHANG: this input takes too long\n");
  KeepInput();
  signal(number, SIG_DFL);
  raise(number);
}

void SetTimers(int cpu_seconds, int seconds) {
  const itimerval cpu = {.it_interval = {}, .it_value = {.tv_sec = cpu_seconds, .tv_usec = 0}};
  setitimer(ITIMER_PROF, &cpu, nullptr);
  alarm(static_cast<unsigned>(seconds));
}

}  // namespace

void Watch(const std::string& own_program, const std::filesystem::path& folder) {
  std::strncpy(program, own_program.c_str(), sizeof(program) - 1);
  if (!folder.empty()) {
    const std::string name = std::filesystem::path(own_program).filename().string() + "." + std::to_string(getpid()) + ".input";
    std::strncpy(path, (std::filesystem::absolute(folder) / name).c_str(), sizeof(path) - 1);
  }
  // Of its own, so that an exhausted stack can still be reported.
  static std::vector<char> stack(1 << 16);
  const stack_t alternative = {.ss_sp = stack.data(), .ss_flags = 0, .ss_size = stack.size()};
  sigaltstack(&alternative, nullptr);
  struct sigaction action = {};
  action.sa_handler = OnSignal;
  action.sa_flags = SA_ONSTACK;
  for (const int number : {SIGABRT, SIGFPE, SIGPROF, SIGALRM}) sigaction(number, &action, nullptr);
#ifdef __SANITIZE_ADDRESS__
  // Its shadow takes terabytes of addresses, and it reports the rest itself.
  __sanitizer_set_death_callback(KeepInput);
#else
  for (const int number : {SIGSEGV, SIGBUS, SIGILL}) sigaction(number, &action, nullptr);
#ifndef __SANITIZE_THREAD__
  const rlimit memory = {.rlim_cur = kMemoryMax, .rlim_max = kMemoryMax};
  setrlimit(RLIMIT_AS, &memory);
#endif
#endif
  const rlimit no_core = {.rlim_cur = 0, .rlim_max = 0};
  setrlimit(RLIMIT_CORE, &no_core);
}

void KeepNoInput() { *path = '\0'; }

void WatchedInputBegins(std::string_view input) {
  current = input.data();
  current_size = input.size();
  SetTimers(kCpuSecondsMax, kSecondsMax);
}

void WatchedInputEnds() {
  SetTimers(0, 0);
  current = nullptr;
}

}  // namespace vorocast::fuzz
