// SPDX-License-Identifier: AGPL-3.0-or-later
// A take that is guided in stretches, held to its known motion and to the guide of the whole.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/unit/workers/tracking/limb.h"
#include "workers/tracking/tracking.h"

namespace vorocast::tracking {
namespace {

using geometry::PoseTrack;
using geometry::Quat;
using geometry::Rigid3;
using geometry::Stretch;
using geometry::TriangleMesh;
using geometry::Vec3;
using testing::ElementsAre;
using testing::HasSubstr;

/// The lattice template, as if cut from a frame in which the limb was bent.
geometry::Template BentTemplate(std::int32_t frame, double angle) {
  geometry::Template own = LimbTemplate(frame);
  for (auto* points : {&own.cells.sites, &own.cells.centroid, &own.cells.vertices}) {
    for (Vec3& x : *points) x = Bend(x, angle);
  }
  return own;
}

/// A limb that bends back and forth for 40 frames, cut into three stretches with frames of their own in their midst.
class StretchesTest : public testing::Test {
 protected:
  static constexpr std::int32_t kFrames = 40;
  static double Angle(std::int32_t f) { return 0.6 * std::sin(0.15 * (f - kTemplate)); }
  static constexpr std::int32_t kTemplate = 16;

  StretchesTest() {
    for (std::int32_t f = 0; f < kFrames; ++f) frames.push_back(Observe(f, Bent(LimbMesh(), Angle(f)), 6000, 0.001));
  }
  Stretch Follow(std::int32_t first, std::int32_t last, std::int32_t own) const {
    const std::vector<Observation> part(frames.begin() + first, frames.begin() + last);
    auto stretch = FollowStretch(BentTemplate(own, Angle(own)), part, {}, {});
    EXPECT_TRUE(stretch.ok()) << stretch.status();
    return *std::move(stretch);
  }
  std::vector<Stretch> FollowAll() const { return {Follow(0, 16, 7), Follow(11, 30, 20), Follow(25, kFrames, 33)}; }
  std::vector<Observation> Seen(const std::vector<std::int32_t>& numbers) const {
    std::vector<Observation> seen;
    for (const std::int32_t f : numbers) seen.push_back(frames[f]);
    return seen;
  }
  /// Mean distance of the limb's vertices from the truth, over the track's frames, in millimetres.
  double ErrorMm(const PoseTrack& track) const {
    AssembleOptions options;
    options.frames = track.frames;
    const auto take = Assemble(model, {track}, options);
    EXPECT_TRUE(take.ok()) << take.status();
    const TriangleMesh rest = LimbMesh();
    const auto carried = CarryPoints(*take, rest.vertices);
    double sum = 0;
    for (std::size_t f = 0; f < track.frames.size(); ++f) {
      const TriangleMesh truth = Bent(LimbMesh(), Angle(track.frames[f]));
      for (std::size_t i = 0; i < rest.vertices.size(); ++i) sum += (carried[f * rest.vertices.size() + i] - truth.vertices[i]).norm();
    }
    return 1000 * sum / static_cast<double>(carried.size());
  }
  std::vector<std::int32_t> AllFrames() const {
    std::vector<std::int32_t> all;
    for (std::int32_t f = 0; f < kFrames; ++f) all.push_back(f);
    return all;
  }

  geometry::Template model = LimbTemplate(kTemplate);
  std::vector<Observation> frames;
};

TEST_F(StretchesTest, CarryTheTemplateAsWellAsTheGuideOfTheWhole) {
  const std::vector<Stretch> stretches = FollowAll();
  const auto seams = SeamFrames(stretches);
  ASSERT_TRUE(seams.ok()) << seams.status();
  EXPECT_THAT(*seams, ElementsAre(13, 27));
  const auto joined = JoinStretches(model, stretches, Seen(*seams), {}, {});
  ASSERT_TRUE(joined.ok()) << joined.status();
  EXPECT_THAT(joined->frames, ElementsAre(13, kTemplate, 27));
  const auto carried = CarryAlongStretches(model, *joined, stretches, AllFrames());
  ASSERT_TRUE(carried.ok()) << carried.status();
  const auto whole = Guide(model, frames, {}, {});
  ASSERT_TRUE(whole.ok()) << whole.status();
  EXPECT_LT(ErrorMm(*carried), std::max(4.0, 1.2 * ErrorMm(*whole)));
}

TEST_F(StretchesTest, AWindowNeedsOnlyTheStretchesItLiesIn) {
  const std::vector<Stretch> stretches = FollowAll();
  const auto joined = JoinStretches(model, stretches, Seen(*SeamFrames(stretches)), {}, {});
  ASSERT_TRUE(joined.ok()) << joined.status();
  const std::vector<std::int32_t> window{30, 31, 32};
  const auto all = CarryAlongStretches(model, *joined, stretches, window);
  const auto one = CarryAlongStretches(model, *joined, {stretches[2]}, window);
  ASSERT_TRUE(all.ok() && one.ok());
  for (std::size_t i = 0; i < all->world_from_template.size(); ++i) {
    EXPECT_EQ(all->world_from_template[i].translation, one->world_from_template[i].translation);
    EXPECT_EQ(all->world_from_template[i].rotation.coeffs(), one->world_from_template[i].rotation.coeffs());
  }
  EXPECT_THAT(std::string(CarryAlongStretches(model, *joined, {stretches[0]}, window).status().message()), HasSubstr("frame 30"));
}

TEST_F(StretchesTest, BadFramesAtASeamDoNoHarm) {
  for (const std::int32_t f : {12, 13, 14}) frames[f] = Observation{.frame = f, .missing = true};
  const std::vector<Stretch> stretches = FollowAll();
  const auto seams = SeamFrames(stretches);
  ASSERT_TRUE(seams.ok()) << seams.status();
  EXPECT_THAT(*seams, ElementsAre(15, 27));
  const auto joined = JoinStretches(model, stretches, Seen(*seams), {}, {});
  ASSERT_TRUE(joined.ok()) << joined.status();
  const auto carried = CarryAlongStretches(model, *joined, stretches, AllFrames());
  ASSERT_TRUE(carried.ok()) << carried.status();
  EXPECT_LT(ErrorMm(*carried), 5.0);
}

TEST_F(StretchesTest, SayWhatIsWrong) {
  const std::vector<Stretch> apart{Follow(0, 5, 2), Follow(5, 10, 7)};
  EXPECT_THAT(std::string(SeamFrames(apart).status().message()), HasSubstr("share no frame"));
  EXPECT_FALSE(SeamFrames({}).ok());
  EXPECT_THAT(std::string(JoinStretches(model, {apart[0]}, {}, {}, {}).status().message()), HasSubstr("template's frame 16"));
  geometry::Template other = model;
  other.frame = 3;
  EXPECT_THAT(std::string(JoinStretches(other, {Follow(0, 6, 2), Follow(3, 9, 7)}, {}, {}, {}).status().message()), HasSubstr("frame 4"));
}

TEST(Guide, FindsTheSpeedOfALimbThatIsMovingInTheTemplate) {
  // The far end moves 9 cm a frame, more than any association reaches, on both sides of the template's frame.
  geometry::Template model = LimbTemplate(4);
  std::vector<Observation> frames;
  std::vector<Rigid3> truth;
  for (std::int32_t f = 0; f < 9; ++f) {
    truth.push_back({Quat(Eigen::AngleAxisd(0.12 * (f - 4), Vec3::UnitY())), Vec3(0.03 * (f - 4), 0, 0)});
    frames.push_back(Observe(f, Moved(LimbMesh(), truth.back()), 6000, 0.001));
  }
  const auto guide = Guide(model, frames, {}, {});
  ASSERT_TRUE(guide.ok()) << guide.status();
  double sum = 0;
  for (std::size_t f = 0; f < 9; ++f) {
    for (std::size_t c = 0; c < model.cells.size(); ++c) {
      const Vec3& x = model.cells.centroid[c];
      sum += (guide->Pose(f, model.patch[c]) * x - truth[f] * x).norm();
    }
  }
  EXPECT_LT(1000 * sum / static_cast<double>(9 * model.cells.size()), 5.0);
}

}  // namespace
}  // namespace vorocast::tracking
