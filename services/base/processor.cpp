// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/base/processor.h"

#include <cstdio>

namespace vorocast::base {

bool CheckProcessor() {
#if defined(__AVX2__) && defined(__FMA__)
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) {
    std::fputs("This build needs a processor with AVX2 and FMA (x86-64-v3). Build again with -DVOROCAST_MARCH=x86-64 for this machine.\n", stderr);
    return false;
  }
#endif
  return true;
}

}  // namespace vorocast::base
