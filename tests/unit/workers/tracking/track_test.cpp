// SPDX-License-Identifier: AGPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "services/base/random.h"
#include "tests/unit/workers/tracking/limb.h"
#include "workers/tracking/tracking.h"

namespace vorocast::tracking {
namespace {

/// The limb is smooth, without the relief that tells where a surface is along itself, and cells that may stretch slide on it: farther than the 2 mm
/// (95 %: 6 mm) that a capture is held to, but no part of it may be lost.
constexpr double kSmoothMeanMm = 5;
constexpr double kSmoothHighMm = 12;

using geometry::FrameState;
using geometry::PoseTrack;
using geometry::Quat;
using geometry::Rigid3;
using geometry::TriangleMesh;
using geometry::Vec3;

struct Errors {
  double mean_mm = 0;
  double high_mm = 0;  // 95 %
};

/// Distances between the limb's vertices as the take carries them and where they truly are.
Errors ErrorsAgainst(const geometry::TrackedTake& take, const std::vector<TriangleMesh>& truth) {
  const TriangleMesh rest = LimbMesh();
  const auto carried = CarryPoints(take, rest.vertices);
  std::vector<double> errors;
  for (std::size_t f = 0; f < truth.size(); ++f) {
    for (std::size_t i = 0; i < rest.vertices.size(); ++i)
      errors.push_back(1000 * (carried[f * rest.vertices.size() + i] - truth[f].vertices[i]).norm());
  }
  std::ranges::sort(errors);
  double sum = 0;
  for (const double e : errors) sum += e;
  return {sum / static_cast<double>(errors.size()), errors[errors.size() * 95 / 100]};
}

/// A limb that bends by up to 40°, by 5° a frame.
struct BendingTake {
  explicit BendingTake(double noise_m, std::int32_t frames = 12) : model(LimbTemplate(0)) {
    for (std::int32_t f = 0; f < frames; ++f) {
      truth.push_back(Bent(LimbMesh(), 0.7 * std::sin(0.13 * f)));
      observed.push_back(Observe(f, truth.back(), 6000, noise_m));
      options.frames.push_back(f);
    }
  }
  absl::StatusOr<geometry::TrackedTake> Track() const {
    auto guide = Guide(model, observed, {}, {});
    if (!guide.ok()) return guide.status();
    auto track = TrackWindow(model, observed, *guide, {}, {});
    if (!track.ok()) return track.status();
    return Assemble(model, {*track}, options);
  }
  geometry::Template model;
  std::vector<TriangleMesh> truth;
  std::vector<Observation> observed;
  AssembleOptions options;
};

TEST(TrackWindow, RecoversARigidMotion) {
  const geometry::Template model = LimbTemplate(0);
  const Rigid3 motion{Quat(Eigen::AngleAxisd(0.08, Vec3(1, 2, -1).normalized())), Vec3(0.01, -0.006, 0.008)};
  const std::vector<Observation> window{Observe(1, Moved(LimbMesh(), motion), 20000, 0)};
  const auto track = TrackWindow(model, window, ConstantTrack(model, {1}, {}), {}, {});
  ASSERT_TRUE(track.ok()) << track.status();
  ASSERT_EQ(track->cell_pose.size(), model.cells.size());
  // The limb is smooth: along itself its place is known only through its ends, and the start is 14 mm away, farther than any guide leaves it.
  double patches = 0;
  double cells = 0;
  for (std::size_t c = 0; c < model.cells.size(); ++c) {
    const Vec3& x = model.cells.centroid[c];
    patches += (track->Pose(0, model.patch[c]) * x - motion * x).norm() / static_cast<double>(model.cells.size());
    cells += (track->cell_pose[c] * x - motion * x).norm() / static_cast<double>(model.cells.size());
    EXPECT_LT((track->cell_pose[c] * x - motion * x).norm(), 6e-3) << c;
  }
  EXPECT_LT(patches, 2e-3);
  EXPECT_LT(cells, 2e-3);
  EXPECT_LT(track->residual[0], 0.5e-3);
  EXPECT_GT(track->confidence[0], 0.99);
}

TEST(TrackWindow, FollowsABendingLimbFarFromTheOrigin) {
  BendingTake take(0.001);
  const Rigid3 away{Quat(Eigen::AngleAxisd(1, Vec3(1, 1, 0).normalized())), Vec3(200, -50, 120)};
  for (auto& observation : take.observed) {
    for (Vec3& x : observation.surface.positions) x = away * x;
    for (Vec3& n : observation.surface.normals) n = away.rotation * n;
    for (Vec3& x : observation.inner) x = away * x;
  }
  for (TriangleMesh& mesh : take.truth) mesh = Moved(mesh, away);
  // The template moves with the take: cells and their polyhedra.
  for (auto* points : {&take.model.cells.sites, &take.model.cells.centroid, &take.model.cells.vertices}) {
    for (Vec3& x : *points) x = away * x;
  }
  const auto tracked = take.Track();
  ASSERT_TRUE(tracked.ok()) << tracked.status();
  TriangleMesh rest = Moved(LimbMesh(), away);
  const auto carried = CarryPoints(*tracked, rest.vertices);
  double sum = 0;
  for (std::size_t f = 0; f < take.truth.size(); ++f) {
    for (std::size_t i = 0; i < rest.vertices.size(); ++i) sum += (carried[f * rest.vertices.size() + i] - take.truth[f].vertices[i]).norm();
  }
  EXPECT_LT(1000 * sum / static_cast<double>(carried.size()), kSmoothMeanMm);
}

TEST(TrackWindow, FollowsABendingLimbWithinMillimetres) {
  const BendingTake take(0.001);
  const auto tracked = take.Track();
  ASSERT_TRUE(tracked.ok()) << tracked.status();
  const Errors errors = ErrorsAgainst(*tracked, take.truth);
  EXPECT_LT(errors.mean_mm, kSmoothMeanMm);
  EXPECT_LT(errors.high_mm, kSmoothHighMm);
}

TEST(TrackWindow, BearsOutliersHolesAndHalvedFrames) {
  BendingTake take(0.001);
  base::Random random(17);
  // A burst of 10 % outliers all around.
  for (int i = 0; i < 600; ++i) {
    take.observed[4].surface.positions.emplace_back(random.Uniform(-0.4, 0.4), random.Uniform(-0.4, 0.4), random.Uniform(-0.2, 0.2));
    take.observed[4].surface.normals.push_back(Vec3(random.Gaussian(), random.Gaussian(), random.Gaussian()).normalized());
  }
  // Every other point gone, and one end cut off.
  auto& halved = take.observed[7].surface;
  geometry::OrientedPoints kept;
  for (std::size_t i = 0; i < halved.size(); i += 2) {
    if (halved.positions[i].x() < -0.24) continue;
    kept.positions.push_back(halved.positions[i]);
    kept.normals.push_back(halved.normals[i]);
  }
  halved = kept;
  // Bad numbers.
  take.observed[9].surface.positions[3].x() = std::numeric_limits<double>::quiet_NaN();
  take.observed[9].surface.normals[5].setZero();
  const auto tracked = take.Track();
  ASSERT_TRUE(tracked.ok()) << tracked.status();
  const Errors errors = ErrorsAgainst(*tracked, take.truth);
  EXPECT_LT(errors.mean_mm, kSmoothMeanMm);
  EXPECT_LT(errors.high_mm, kSmoothHighMm);
  EXPECT_LT(tracked->patches.confidence[4], tracked->patches.confidence[5]);
}

TEST(TrackWindow, InterpolatesAMissingFrame) {
  BendingTake take(0.001);
  take.observed[5] = Observation{.frame = 5, .missing = true};
  const auto tracked = take.Track();
  ASSERT_TRUE(tracked.ok()) << tracked.status();
  EXPECT_EQ(tracked->patches.state[5], FrameState::kInterpolated);
  EXPECT_EQ(std::ranges::count(tracked->patches.state, FrameState::kInterpolated), 1);
  EXPECT_LT(ErrorsAgainst(*tracked, take.truth).mean_mm, kSmoothMeanMm);
}

TEST(TrackWindow, DependsOnItsInputsAlone) {
  const BendingTake take(0.001, 10);
  const auto guide = Guide(take.model, take.observed, {}, {});
  ASSERT_TRUE(guide.ok()) << guide.status();
  const std::vector<Observation> window(take.observed.begin() + 3, take.observed.begin() + 8);
  const auto first = TrackWindow(take.model, window, *guide, {}, {});
  // The same window from a start that holds its frames only, and other poses for the rest.
  PoseTrack other = *guide;
  for (const std::size_t f : {0u, 1u, 2u, 8u, 9u}) other.Pose(f, 0).translation.x() += 1;
  const auto second = TrackWindow(take.model, window, other, {}, {});
  ASSERT_TRUE(first.ok() && second.ok());
  for (std::size_t i = 0; i < first->world_from_template.size(); ++i) {
    EXPECT_EQ(first->world_from_template[i].translation, second->world_from_template[i].translation);
    EXPECT_EQ(first->world_from_template[i].rotation.coeffs(), second->world_from_template[i].rotation.coeffs());
  }
}

TEST(TrackWindow, SaysWhatIsWrong) {
  const geometry::Template model = LimbTemplate(0);
  const std::vector<Observation> window{Observe(3, LimbMesh(), 500, 0)};
  const auto message = [&](const geometry::Template& m, const std::vector<Observation>& w, const PoseTrack& s, const TrackOptions& o) {
    return std::string(TrackWindow(m, w, s, o, {}).status().message());
  };
  const PoseTrack start = ConstantTrack(model, {3}, {});
  EXPECT_THAT(message(model, {}, start, {}), testing::HasSubstr("no frames"));
  EXPECT_THAT(message(model, window, ConstantTrack(model, {4}, {}), {}), testing::HasSubstr("frame 3"));
  EXPECT_THAT(message(model, window, start, {.iterations = 0}), testing::HasSubstr("iterations"));
  EXPECT_THAT(message(model, {window[0], window[0]}, start, {}), testing::HasSubstr("ascend"));
  std::vector<Observation> short_of_normals = window;
  short_of_normals[0].surface.normals.pop_back();
  EXPECT_THAT(message(model, short_of_normals, start, {}), testing::HasSubstr("frame 3: 500 surface points with 499 normals"));
  geometry::Template empty_patch = model;
  ++empty_patch.patch_count;
  EXPECT_THAT(message(empty_patch, window, start, {}), testing::HasSubstr("has no cells"));
}

TEST(Guide, FollowsOutwardFromATemplateInTheMiddle) {
  BendingTake take(0.001);
  // The template's frame is 6: turn the take so that the limb is straight there.
  for (std::int32_t f = 0; f < 12; ++f) {
    take.truth[f] = Bent(LimbMesh(), 0.1 * (f - 6));
    take.observed[f] = Observe(f, take.truth[f], 6000, 0.001);
  }
  take.model.frame = 6;
  const auto guide = Guide(take.model, take.observed, {}, {});
  ASSERT_TRUE(guide.ok()) << guide.status();
  const auto rough = Assemble(take.model, {*guide}, take.options);
  ASSERT_TRUE(rough.ok()) << rough.status();
  EXPECT_LT(ErrorsAgainst(*rough, take.truth).mean_mm, 5.0);
}

TEST(Guide, FollowsAFastSwing) {
  // The far end moves 9 cm a frame, more than any association reaches: only going on at the last speed finds it.
  BendingTake take(0.001, 10);
  for (std::int32_t f = 0; f < 10; ++f) {
    const double turn = 0.03 * f * f;
    take.truth[f] = Moved(LimbMesh(), {Quat(Eigen::AngleAxisd(turn, Vec3::UnitY())), Vec3(0.004 * f * f, 0, 0)});
    take.observed[f] = Observe(f, take.truth[f], 6000, 0.001);
  }
  const auto tracked = take.Track();
  ASSERT_TRUE(tracked.ok()) << tracked.status();
  EXPECT_LT(ErrorsAgainst(*tracked, take.truth).mean_mm, kSmoothMeanMm);
}

TEST(Guide, RefusesATakeWithoutFrames) {
  EXPECT_FALSE(Guide(LimbTemplate(0), {}, {}, {}).ok());
  EXPECT_FALSE(Guide(LimbTemplate(0), {Observation{.frame = 0, .missing = true}}, {}, {}).ok());
}

}  // namespace
}  // namespace vorocast::tracking
