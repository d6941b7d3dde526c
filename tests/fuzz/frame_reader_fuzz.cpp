// SPDX-License-Identifier: AGPL-3.0-or-later
// libFuzzer on the frame readers: the first byte picks a format, the rest is the file. Starts from the unit tests' corpus, without files.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "services/base/random.h"
#include "services/capture/frame_parser.h"
#include "tests/unit/services/capture/frame_files.h"

namespace {

constexpr std::array<std::string_view, 4> kExtensions = {".ply", ".obj", ".off", ".drc"};

std::uint8_t FormatByte(std::string_view extension) {
  return static_cast<std::uint8_t>(std::ranges::find(kExtensions, extension) - kExtensions.begin());
}

}  // namespace

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* bytes, std::size_t size, std::size_t size_max);

/// Now and then starts again from a valid file: without a corpus folder, that is where all inputs come from.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* bytes, std::size_t size, std::size_t size_max, unsigned int seed) {
  static const auto corpus = vorocast::capture::testing::Corpus();
  vorocast::base::Random random(seed);
  if (size < 16 || random.Below(500) == 0) {
    const auto& file = corpus[random.Below(corpus.size())];
    if (file.bytes.size() + 1 <= size_max) {
      bytes[0] = FormatByte(file.extension);
      std::memcpy(bytes + 1, file.bytes.data(), file.bytes.size());
      size = file.bytes.size() + 1;
    }
  }
  return LLVMFuzzerMutate(bytes, size, size_max);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view file(reinterpret_cast<const char*>(bytes + 1), size - 1);
  auto raw = vorocast::capture::ParseFrame(kExtensions[bytes[0] % kExtensions.size()], file);
  if (!raw.ok()) return 0;
  // Estimating normals is CGAL's, and slow; the readers are what is tested here.
  (void)vorocast::capture::ConvertFrame(std::move(raw).value(), {.estimate_normals = false});
  return 0;
}
