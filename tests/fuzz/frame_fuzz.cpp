// SPDX-License-Identifier: AGPL-3.0-or-later
// Captured frames. An input's first line is the extension, the rest is the file.
#include "services/capture/frame_parser.h"
#include "tests/fuzz/subject.h"
#include "tests/unit/services/capture/frame_files.h"

namespace vorocast::fuzz {

const Subject kSubject = {.form = Form::kText};

std::vector<std::string> MadeInputs() {
  std::vector<std::string> inputs;
  for (const auto& file : capture::testing::Corpus()) inputs.push_back(file.extension + "\n" + file.bytes);
  return inputs;
}

}  // namespace vorocast::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using vorocast::fuzz::Require;
  const std::string_view input = vorocast::fuzz::View(bytes, size);
  const std::size_t line = input.find('\n');
  if (line == std::string_view::npos) return 0;
  auto raw = vorocast::capture::ParseFrame(input.substr(0, line), input.substr(line + 1));
  if (!raw.ok()) return 0;
  // Estimating normals is CGAL's, and slow; the readers are what is tested here.
  const auto frame = vorocast::capture::ConvertFrame(std::move(raw).value(), {.estimate_normals = false});
  if (!frame.ok()) return 0;
  for (const auto& position : frame->points.positions) Require(position.allFinite(), "a position that is not finite");
  for (const auto& triangle : frame->mesh.triangles) {
    for (const std::int32_t corner : triangle)
      Require(corner >= 0 && std::size_t(corner) < frame->mesh.vertices.size(), "a corner that is not there");
  }
  return 0;
}
