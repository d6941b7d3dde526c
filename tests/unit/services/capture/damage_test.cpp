// SPDX-License-Identifier: AGPL-3.0-or-later
// Damaged files: every prefix and thousands of random changes of valid ones. None may crash a reader or make it ask for more memory
// than the file's size justifies.
#include <gtest/gtest.h>

#include "services/base/random.h"
#include "services/capture/frame_parser.h"
#include "tests/unit/services/capture/allocation_watch.h"
#include "tests/unit/services/capture/frame_files.h"

namespace vorocast::capture {
namespace {

/// What a parser may ask for at once for a file of `bytes`: a fixed multiple, and some slack for small files.
std::size_t Allowance(std::size_t bytes) { return 512 * bytes + (4 << 20); }

/// Parses, and follows up with the conversion when that succeeds: it must cope with whatever a parser lets through.
bool Survives(const std::string& extension, const std::string& bytes) {
  testing::WatchAllocations();
  auto raw = ParseFrame(extension, bytes);
  const bool parsed = raw.ok();
  if (parsed) {
    const auto frame = ConvertFrame(std::move(raw).value(), {});
    if (frame.ok()) {
      EXPECT_EQ(frame->points.positions.size(), frame->points.normals.size());
      for (const auto& n : frame->points.normals) EXPECT_NEAR(n.norm(), 1, 1e-9);
      for (const auto& p : frame->points.positions) EXPECT_TRUE(p.allFinite());
      for (const auto& t : frame->mesh.triangles) {
        for (std::int32_t v : t) EXPECT_TRUE(v >= 0 && static_cast<std::size_t>(v) < frame->points.size());
      }
    } else {
      EXPECT_FALSE(frame.status().message().empty());
    }
  }
  EXPECT_LE(testing::LargestAllocation(), Allowance(bytes.size()));
  return parsed;
}

class Damage : public ::testing::TestWithParam<testing::CorpusFile> {};

TEST_P(Damage, TheWholeFileIsRead) { EXPECT_TRUE(Survives(GetParam().extension, GetParam().bytes)); }

TEST_P(Damage, EveryPrefixIsSurvived) {
  const testing::CorpusFile& file = GetParam();
  std::size_t parsed = 0;
  for (std::size_t size = 0; size < file.bytes.size(); ++size) parsed += Survives(file.extension, file.bytes.substr(0, size)) ? 1 : 0;
  // OBJ declares nothing, so that a cut between lines goes unseen; all others notice.
  if (file.extension == ".obj") return;
  EXPECT_LE(parsed, file.extension == ".drc" ? file.bytes.size() / 10 : 2);
}

TEST_P(Damage, RandomChangesAreSurvived) {
  const testing::CorpusFile& file = GetParam();
  base::Random random(20);
  for (int round = 0; round < 4000; ++round) {
    std::string bytes = file.bytes;
    const std::uint64_t changes = 1 + random.Below(4);
    for (std::uint64_t i = 0; i < changes; ++i) {
      const std::size_t at = random.Below(bytes.size());
      switch (random.Below(4)) {
        case 0:
          bytes[at] = static_cast<char>(bytes[at] ^ (1 << random.Below(8)));
          break;
        case 1:
          bytes[at] = static_cast<char>(random.Below(256));
          break;
        case 2:
          bytes.insert(at, 1, static_cast<char>(random.Below(2) == 0 ? '9' : random.Below(256)));
          break;
        default:
          bytes.erase(at, 1);
      }
    }
    SCOPED_TRACE(round);
    Survives(file.extension, bytes);
  }
}

INSTANTIATE_TEST_SUITE_P(Corpus, Damage, ::testing::ValuesIn(testing::Corpus()), [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace vorocast::capture
