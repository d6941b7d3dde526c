// SPDX-License-Identifier: AGPL-3.0-or-later
// capture.json, beside one frame.
#include <cmath>

#include "services/capture/capture.h"
#include "tests/fuzz/scratch_folder.h"
#include "tests/fuzz/subject.h"

namespace vorocast::fuzz {

const Subject kSubject = {.form = Form::kJson};
std::vector<std::string> MadeInputs() { return {VeryDeep(R"({"name": )", "}")}; }

}  // namespace vorocast::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace vorocast;
  static const fuzz::ScratchFolder folder;
  static const auto frame = folder.Write("frame_0.ply", "");
  folder.Write("capture.json", fuzz::View(bytes, size));
  const auto capture = capture::OpenCapture(folder.path(), {});
  if (!capture.ok()) return 0;
  fuzz::Require(capture->frames_per_second > 0 && capture->frames_per_second <= 1000, "frames_per_second");
  fuzz::Require(capture->metres_per_unit > 0 && std::isfinite(capture->metres_per_unit), "unit");
  fuzz::Require(capture->up.size() == 2 && capture->components >= 0 && !capture->name.empty(), "up, components or name");
  return 0;
}
