// SPDX-License-Identifier: AGPL-3.0-or-later
// Artifacts as raw bytes, of which the HDF5 library is known to crash on some: every one is read in a process of its own, as workers do.
#include "tests/fuzz/artifact_files.h"
#include "tests/fuzz/subject.h"

namespace vorocast::fuzz {

const Subject kSubject = {.form = Form::kBytes, .contained = true};

std::vector<std::string> MadeInputs() { return SmallArtifacts(); }

}  // namespace vorocast::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace vorocast;
  fuzz::ReadEveryWay(fuzz::ArtifactFolder().Write("input.h5", fuzz::View(bytes, size)));
  return 0;
}
