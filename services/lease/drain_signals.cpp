// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/drain_signals.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <utility>

#include "services/base/check.h"

namespace vorocast::lease {
namespace {

/// What the thread is told through the event descriptor, the only thing that a signal handler may touch: signals count one each.
constexpr std::uint64_t kEnd = 1ULL << 32;
int event_fd = -1;

void Tell(std::uint64_t value) {
  const int earlier_errno = errno;
  [[maybe_unused]] const ssize_t written = ::write(event_fd, &value, sizeof(value));
  errno = earlier_errno;
}

void OnSignal(int) { Tell(1); }

}  // namespace

DrainSignals::DrainSignals(std::function<void()> on_signal) {
  VOROCAST_CHECK(event_fd < 0);
  event_fd = ::eventfd(0, EFD_CLOEXEC);
  VOROCAST_CHECK(event_fd >= 0);
  thread_ = std::thread([on_signal = std::move(on_signal)] {
    for (;;) {
      std::uint64_t told = 0;
      if (::read(event_fd, &told, sizeof(told)) != sizeof(told)) continue;
      for (std::uint64_t i = 0; i < told % kEnd; ++i) on_signal();
      if (told >= kEnd) return;
    }
  });
  struct sigaction action {};
  action.sa_handler = OnSignal;
  action.sa_flags = SA_RESTART;
  ::sigaction(SIGTERM, &action, &earlier_term_);
  ::sigaction(SIGINT, &action, &earlier_int_);
  action.sa_handler = SIG_IGN;
  ::sigaction(SIGPIPE, &action, &earlier_pipe_);
}

DrainSignals::~DrainSignals() {
  ::sigaction(SIGTERM, &earlier_term_, nullptr);
  ::sigaction(SIGINT, &earlier_int_, nullptr);
  ::sigaction(SIGPIPE, &earlier_pipe_, nullptr);
  Tell(kEnd);
  thread_.join();
  ::close(std::exchange(event_fd, -1));
}

}  // namespace vorocast::lease
