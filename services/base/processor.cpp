// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/base/processor.h"

#include <unistd.h>

#include <cstdlib>

namespace vorocast::base {

#ifdef __AVX2__
namespace {

/// Compiled for the oldest processor, and run before every other constructor of the program.
[[gnu::constructor(101), gnu::target("arch=x86-64")]] void Check() {
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2")) return;
  static constexpr char kMessage[] = "vorocast: this processor lacks AVX2, FMA or BMI2; use another machine, or build with -DVOROCAST_MARCH=x86-64\n";
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, kMessage, sizeof(kMessage) - 1);
  ::_exit(EXIT_FAILURE);
}

}  // namespace
#endif

// Named in main so that the linker takes this file, and with it the constructor, from its library.
void RequireProcessor() {}

}  // namespace vorocast::base
