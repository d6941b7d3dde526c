// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/synth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <numeric>
#include <sstream>

#include "services/capture/frame_reader.h"
#include "services/storage/truth.h"
#include "services/synth/performance.h"
#include "tests/unit/services/synth/closest_point.h"

namespace vorocast::synth {
namespace {

using geometry::Vec3;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

/// A folder of this process alone (tests run side by side), gone when it ends.
const fs::path& ScratchRoot() {
  struct Scratch {
    fs::path path = fs::path(testing::TempDir()) / ("vorocast_synth_" + std::to_string(getpid()));
    ~Scratch() {
      std::error_code ignored;
      fs::remove_all(path, ignored);
    }
  };
  static const Scratch kScratch;
  return kScratch.path;
}

fs::path FreshFolder(const std::string& name) {
  const fs::path folder = ScratchRoot() / name;
  fs::remove_all(folder);
  return folder;
}

std::string Bytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream bytes;
  bytes << file.rdbuf();
  return bytes.str();
}

/// A tetrahedron of half a metre, moved along x by a metre a frame; twisted connectivity in the frame named by `twisted`.
fs::path TetrahedronTake(const std::string& name, int frames, int twisted = -1) {
  const fs::path folder = FreshFolder(name);
  fs::create_directories(folder);
  for (int f = 0; f < frames; ++f) {
    std::ofstream file(folder / ("mesh_" + std::to_string(f) + ".obj"));
    file << "v " << f << " 0 0\nv " << f + 0.5 << " 0 0\nv " << f << " 0.5 0\nv " << f << " 0 0.5\n";
    file << (f == twisted ? "f 1 3 4\nf 1 2 3\nf 1 4 2\nf 2 4 3\n" : "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
  }
  return folder;
}

constexpr SynthOptions SmallTake() {
  SynthOptions options;
  options.frames = 3;
  options.points = 20'000;
  return options;
}

/// One take for the tests that only look.
const fs::path& SharedTake() {
  static const fs::path kFolder = [] {
    const fs::path folder = FreshFolder("shared");
    EXPECT_TRUE(SynthesiseCapture(folder, SmallTake()).ok());
    return folder;
  }();
  return kFolder;
}

TEST(SynthesiseCapture, IsACaptureLikeAnyOther) {
  const auto capture = capture::OpenCapture(SharedTake(), {});
  ASSERT_TRUE(capture.ok()) << capture.status();
  EXPECT_EQ(capture->frames.size(), 3u);
  EXPECT_EQ(capture->frames_per_second, 25);
  EXPECT_EQ(capture->metres_per_unit, 1);
  EXPECT_EQ(capture->components, 2);
  const auto frame = capture::ReadFrame(capture->frames[2].path, {});
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_FALSE(frame->notes.normals_estimated);
  EXPECT_EQ(frame->notes.dropped_points, 0);
  EXPECT_LE(frame->points.size(), 20'000u);
  EXPECT_GT(frame->points.size(), 19'000u);
  EXPECT_EQ(frame->points.colours.size(), frame->points.size());
}

TEST(SynthesiseCapture, PointsLieOnTheDancerAndLookOutward) {
  const Dance dance(3, 25);
  geometry::TriangleMesh mesh = dance.surface();
  mesh.vertices = dance.VerticesAt(1);
  const ClosestPoint surface(mesh);
  const auto frame = capture::ReadFrame(SharedTake() / "frame_0001.ply", {});
  ASSERT_TRUE(frame.ok()) << frame.status();
  int far = 0, inward = 0;
  double sum2 = 0;
  for (std::size_t i = 0; i < frame->points.size(); ++i) {
    const ClosestPoint::Found found = surface.Nearest(frame->points.positions[i]);
    if (found.distance > 0.005) {
      ++far;  // five standard deviations: only a flying pixel
      continue;
    }
    sum2 += found.distance * found.distance;
    if (found.normal.dot(frame->points.normals[i]) < 0) ++inward;
  }
  const auto count = static_cast<double>(frame->points.size());
  EXPECT_LT(far / count, 0.002);
  EXPECT_LT(std::sqrt(sum2 / count), 0.0011);
  EXPECT_GT(std::sqrt(sum2 / count), 0.0005);
  EXPECT_LT(inward / count, 0.001);  // next to a sharp hem the nearest triangle may be the other side's
}

TEST(SynthesiseCapture, TheTruthIsTheWayOfVerticesThatTheCamerasSee) {
  const auto truth = storage::ReadTruth(SharedTake() / "truth.h5");
  ASSERT_TRUE(truth.ok()) << truth.status();
  EXPECT_EQ(truth->frames_per_second, 25);
  ASSERT_EQ(truth->points.size(), 3u);
  EXPECT_GE(truth->part.size(), 2000u);
  const Dance dance(3, 25);
  const std::vector<Vec3> first = dance.VerticesAt(0), last = dance.VerticesAt(2);
  const auto frame = capture::ReadFrame(SharedTake() / "frame_0000.ply", {});
  ASSERT_TRUE(frame.ok()) << frame.status();
  std::array<int, 10> of_part{};
  std::size_t vertex = 0;
  int far_from_scan = 0;
  for (std::size_t i = 0; i < truth->part.size(); ++i) {
    while (vertex < first.size() && first[vertex] != truth->points[0][i]) ++vertex;
    ASSERT_LT(vertex, first.size()) << "point " << i << " is no vertex of the dance";
    EXPECT_EQ(last[vertex], truth->points[2][i]);
    EXPECT_EQ(dance.part()[vertex], truth->part[i]);
    ++of_part[static_cast<std::size_t>(truth->part[i])];
    if (i % 8 == 0) {
      double nearest = 1;
      for (const Vec3& x : frame->points.positions) nearest = std::min(nearest, (x - truth->points[0][i]).squaredNorm());
      if (nearest > 0.03 * 0.03) ++far_from_scan;
    }
  }
  for (int count : of_part) EXPECT_GT(count, 20);
  EXPECT_LT(far_from_scan, 0.03 * static_cast<double>(truth->part.size()) / 8);
}

TEST(SynthesiseCapture, TheSameOptionsGiveTheSameBytesAndAnotherSeedOthers) {
  const fs::path again = FreshFolder("again");
  double done = 0;
  ASSERT_TRUE(SynthesiseCapture(again, SmallTake(), [&](double fraction) {
                EXPECT_GE(fraction, done);
                done = fraction;
              }).ok());
  EXPECT_EQ(done, 1);
  for (const char* name : {"frame_0000.ply", "frame_0002.ply", "truth.h5", "capture.json"}) {
    EXPECT_EQ(Bytes(SharedTake() / name), Bytes(again / name)) << name;
  }
  const fs::path meshes = TetrahedronTake("seeds", 1);
  const fs::path one = FreshFolder("seed_1"), two = FreshFolder("seed_2");
  ASSERT_TRUE(ScanMeshes(meshes, {}, one, {.points = 1000, .seed = 1}).ok());
  ASSERT_TRUE(ScanMeshes(meshes, {}, two, {.points = 1000, .seed = 2}).ok());
  EXPECT_NE(Bytes(one / "frame_0000.ply"), Bytes(two / "frame_0000.ply"));
}

TEST(SynthesiseCapture, RefusesWhatItCannotDoAndSaysWhy) {
  SynthOptions options = SmallTake();
  options.frames = 0;
  const fs::path folder = FreshFolder("refused");
  EXPECT_THAT(std::string(SynthesiseCapture(folder, options).message()), HasSubstr("frames is 0; it must be from 1 to"));
  options = SmallTake();
  options.noise_m = std::nan("");
  EXPECT_THAT(std::string(SynthesiseCapture(folder, options).message()), HasSubstr("noise_m is nan"));
  EXPECT_FALSE(fs::exists(folder));
  const absl::Status full = SynthesiseCapture(SharedTake(), SmallTake());
  EXPECT_EQ(full.code(), absl::StatusCode::kAlreadyExists);
  EXPECT_THAT(std::string(full.message()), HasSubstr("is not empty"));
}

TEST(ScanMeshes, KeepsEveryVertexInMetresAndTheSourcesRate) {
  const fs::path meshes = TetrahedronTake("cm", 4), folder = FreshFolder("cm_scanned");
  capture::CaptureOptions source{.frames_per_second = 50, .unit = "cm", .first = 1, .last = 3};
  // Read as centimetres the tetrahedron is smaller than a capture can be, and the reader says so.
  EXPECT_FALSE(ScanMeshes(meshes, source, folder, {.points = 1000}).ok());
  source.unit = "m";
  ASSERT_TRUE(ScanMeshes(meshes, source, folder, {.points = 1000}).ok());
  const auto truth = storage::ReadTruth(folder / "truth.h5");
  ASSERT_TRUE(truth.ok()) << truth.status();
  EXPECT_EQ(truth->frames_per_second, 50);
  ASSERT_EQ(truth->points.size(), 2u);
  EXPECT_EQ(truth->points[0], (std::vector<Vec3>{{1, 0, 0}, {1.5, 0, 0}, {1, 0.5, 0}, {1, 0, 0.5}}));
  EXPECT_EQ(truth->points[1][0], Vec3(2, 0, 0));
  EXPECT_EQ(truth->part, std::vector<std::int32_t>(4, 0));
  const auto capture = capture::OpenCapture(folder, {});
  ASSERT_TRUE(capture.ok()) << capture.status();
  EXPECT_EQ(capture->frames_per_second, 50);
  EXPECT_EQ(capture->components, 1);
}

TEST(ScanMeshes, RefusesPointCloudsAndAnotherConnectivity) {
  const fs::path folder = FreshFolder("never");
  const absl::Status cloud = ScanMeshes(SharedTake(), {}, folder, {});
  EXPECT_THAT(std::string(cloud.message()), HasSubstr("is a point cloud"));
  const absl::Status twisted = ScanMeshes(TetrahedronTake("twisted", 3, 1), {}, folder, {});
  EXPECT_EQ(twisted.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(twisted.message()), HasSubstr("mesh_1.obj"));
  EXPECT_FALSE(fs::exists(folder));
}

TEST(ScanMeshes, TheTruthOfARealPerformanceIsItsVertices) {
  const char* data = std::getenv("VOROCAST_DATA");
  const fs::path crane = (data ? fs::path(data) : fs::path(VOROCAST_SOURCE_DIR) / ".." / "shared" / "data") / "crane";
  if (!fs::exists(crane)) GTEST_SKIP() << crane << " is absent";
  const fs::path folder = FreshFolder("crane");
  ASSERT_TRUE(ScanMeshes(crane, {.first = 10, .last = 13}, folder, {.points = 20'000}).ok());
  const auto truth = storage::ReadTruth(folder / "truth.h5");
  ASSERT_TRUE(truth.ok()) << truth.status();
  ASSERT_EQ(truth->points.size(), 3u);
  for (int f = 0; f < 3; ++f) {
    const auto mesh = capture::ReadRawFrame(crane / ("frame_00" + std::to_string(10 + f) + ".ply"));
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    EXPECT_EQ(truth->points[static_cast<std::size_t>(f)], mesh->mesh.vertices);
    const auto frame = capture::ReadFrame(folder / ("frame_000" + std::to_string(f) + ".ply"), {});
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_GT(frame->points.size(), 18'000u);
    const ClosestPoint surface(mesh->mesh);
    int far = 0;
    for (const Vec3& x : frame->points.positions) far += surface.Distance(x) > 0.005 ? 1 : 0;
    EXPECT_LT(far, 0.002 * static_cast<double>(frame->points.size()));
  }
}

}  // namespace
}  // namespace vorocast::synth
