// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/film.h"

#include <bit>
#include <cmath>
#include <map>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfStringAttribute.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include "services/rendering/cryptomatte.h"
#include "services/rendering/exr.h"
#include "tests/unit/services/storage/sample_takes.h"
#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::rendering {
namespace {

using geometry::CellState;
using geometry::Rigid3;
using geometry::Vec3;
using geometry::Vec3f;

Rigid3 Shift(double x, double y, double z) { return {geometry::Quat::Identity(), Vec3(x, y, z)}; }

/// Three unit cubes in a row, seen from +z at a distance of ten from their near face, 20 pixels a metre there.
struct CubeStage {
  geometry::Cells cells = storage::CubesInARow(3);
  std::vector<std::int32_t> patch = {0, 1, 1};
  FilmSubject subject;
  Camera camera;
  Studio studio{.ground = -5, .extent = 3};

  CubeStage() {
    subject.cells = &cells;
    subject.patch = &patch;
    subject.motion.assign(3, Motion{});
    subject.state.assign(3, CellState::kRecalled);
    subject.seconds_per_picture = 0.5;
    camera.eye = {1.5F, 0.5F, 11};
    camera.width = 100;
    camera.height = 60;
    camera.pixel = 0.005F;
    camera.left = -0.25F;
    camera.top = 0.15F;
  }
  FilmPicture Render(double shutter = 0) const { return RenderFilmPicture(subject, camera, studio, {.samples = 4, .shutter = shutter}, {}).value(); }
};

std::size_t Pixel(int column, int row) { return static_cast<std::size_t>(row * 100 + column); }

TEST(Film, LayersSayWhatIsThere) {
  CubeStage stage;
  // The middle cube comes one metre nearer and 0.2 to the right until the next picture, half a second later.
  stage.subject.motion[1].at_next = Shift(0.2, 0, 1);
  const FilmPicture picture = stage.Render();
  const std::size_t left = Pixel(30, 30), middle = Pixel(50, 30), outside = Pixel(5, 30);
  EXPECT_NEAR(picture.depth[left], 10, 1e-2);
  EXPECT_TRUE(std::isinf(picture.depth[outside]));
  EXPECT_EQ(picture.cell[left], 0);
  EXPECT_EQ(picture.cell[middle], 1);
  EXPECT_EQ(picture.cell[outside], -1);
  EXPECT_EQ(picture.patch[middle], 1);
  EXPECT_LT((picture.normal[middle] - Vec3f::UnitZ()).norm(), 1e-5);
  EXPECT_LT((picture.velocity[middle] - Vec3f(0.4F, 0, 2)).norm(), 1e-3);
  EXPECT_LT(picture.velocity[left].norm(), 1e-5);
  // Pixel (50, 30) looks at x = 0.025 to the right of the axis; at depth 9 it will stand 0.225 from it.
  EXPECT_NEAR(picture.forward[middle][0], 0.225 / 9 / 0.005 - 0.025 / 10 / 0.005, 0.02);
  EXPECT_EQ(picture.rgba[left][3], 1);
  EXPECT_EQ(picture.rgba[outside][3], 0);
  EXPECT_EQ(picture.rgba[outside][0], 0);
}

TEST(Film, CoverageIsTheAreaThatCellsCover) {
  const CubeStage stage;
  const FilmPicture picture = stage.Render();
  std::map<std::int32_t, double> covered;
  double alpha = 0;
  for (std::size_t i = 0; i < picture.rgba.size(); ++i) {
    alpha += picture.rgba[i][3];
    double sum = 0;
    for (const auto& rank : picture.coverage[i]) {
      covered[rank.id] += rank.part;
      sum += rank.part;
    }
    EXPECT_NEAR(sum, picture.rgba[i][3], 1e-6);
  }
  // A face of one metre at depth ten is 20 pixels a side.
  for (int cell = 0; cell < 3; ++cell) EXPECT_NEAR(covered[cell], 400, 12) << cell;
  EXPECT_NEAR(alpha, 1200, 20);
}

TEST(Film, GoneCellsAndScaledOnes) {
  CubeStage stage;
  stage.subject.state[0] = CellState::kGone;
  stage.subject.scale = {1, 0.5F, 1};
  const FilmPicture picture = stage.Render();
  EXPECT_EQ(picture.cell[Pixel(30, 30)], -1);
  double middle = 0;
  for (const auto& pixel : picture.coverage) {
    for (const auto& rank : pixel) middle += rank.id == 1 ? rank.part : 0;
  }
  EXPECT_NEAR(middle, 400 / 4 * std::pow(10 / 10.25, 2), 12);
}

TEST(Film, AnOpenShutterSmearsWhatMoves) {
  CubeStage stage;
  stage.subject.motion[2] = {Shift(0, 0, 0), Shift(0.5, 0, 0), Shift(1, 0, 0)};
  const FilmPicture still = stage.Render(0);
  const FilmPicture moving = stage.Render(0.5);
  // Ten pixels beyond the right edge of the third cube: covered for the last part of the shutter's time at x, a fall from 1 to 0 over 10 pixels.
  EXPECT_EQ(still.rgba[Pixel(84, 30)][3], 0);
  EXPECT_NEAR(moving.rgba[Pixel(84, 30)][3], 0.55, 0.12);
  EXPECT_NEAR(moving.rgba[Pixel(88, 30)][3], 0.15, 0.12);
  EXPECT_EQ(moving.rgba[Pixel(91, 30)][3], 0);
}

TEST(Film, SceneObjectsHaveIdsOfTheirOwn) {
  CubeStage stage;
  const geometry::SceneObject wall{"wall", {{{-2, -2, 2}, {0.5, -2, 2}, {0.5, 2, 2}, {-2, 2, 2}}, {{0, 1, 2}, {0, 2, 3}}, {}}};
  stage.subject.objects = {{&wall, Motion{}}};
  const FilmPicture picture = stage.Render();
  EXPECT_EQ(picture.cell[Pixel(25, 30)], kObjectId);
  EXPECT_NEAR(picture.depth[Pixel(25, 30)], 9, 1e-3);
  EXPECT_EQ(picture.cell[Pixel(50, 30)], 1);
}

TEST(Film, TheSameEveryTime) {
  const CubeStage stage;
  EXPECT_EQ(stage.Render(0.5).rgba, stage.Render(0.5).rgba);
}

TEST(Film, RefusesWhatMakesNoPicture) {
  CubeStage stage;
  EXPECT_EQ(RenderFilmPicture(stage.subject, stage.camera, stage.studio, {.samples = 0}, {}).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(RenderFilmPicture(stage.subject, stage.camera, stage.studio, {.shutter = 2}, {}).status().code(), absl::StatusCode::kInvalidArgument);
  stage.subject.motion[1].at_open.translation.x() = NAN;
  EXPECT_THAT(std::string(RenderFilmPicture(stage.subject, stage.camera, stage.studio, {}, {}).status().message()), ::testing::HasSubstr("cell 1"));
}

// The specification's own examples of names and ids, and MurmurHash3's published test value.
TEST(Cryptomatte, HashesNames) {
  EXPECT_EQ(CryptomatteHash("hello"), 0x248bfa47U);
  EXPECT_EQ(CryptomatteHash("hello, world"), 0x149bbb7fU);
}

class FilmExr : public ::testing::Test {
 protected:
  void SetUp() override {
    stage_.subject.motion[1].at_next = Shift(0.2, 0, 1);
    picture_ = stage_.Render();
    FilmMetadata metadata{.frames_per_second = 30, .seconds = 1.5, .object_names = {"pendulum"}, .comments = {{"vorocast/effect", "release"}}};
    ASSERT_EQ(WriteExr(folder_ / "a.exr", picture_, stage_.camera, stage_.patch, metadata), absl::OkStatus());
  }

  template <typename Stored>
  std::vector<Stored> Channel(int part, const std::string& name, Imf::PixelType type) {
    Imf::MultiPartInputFile file((folder_ / "a.exr").c_str());
    EXPECT_NE(file.header(part).channels().findChannel(name), nullptr) << name;
    std::vector<Stored> values(6000);
    Imf::FrameBuffer buffer;
    buffer.insert(name, Imf::Slice(type, reinterpret_cast<char*>(values.data()), sizeof(Stored), 100 * sizeof(Stored)));
    Imf::InputPart input(file, part);
    input.setFrameBuffer(buffer);
    input.readPixels(0, 59);
    return values;
  }

  TemporaryFolder folder_;
  CubeStage stage_;
  FilmPicture picture_;
};

TEST_F(FilmExr, HasTheLayersByTheirStandardNames) {
  Imf::MultiPartInputFile file((folder_ / "a.exr").c_str());
  ASSERT_EQ(file.parts(), 5);
  EXPECT_EQ(file.header(0).name(), "rgba");
  EXPECT_EQ(file.header(0).typedAttribute<Imf::StringAttribute>("vorocast/effect").value(), "release");
  const std::vector<float> z = Channel<float>(1, "Z", Imf::FLOAT);
  const std::vector<float> alpha = Channel<float>(0, "A", Imf::FLOAT);
  const std::vector<float> normal = Channel<float>(2, "N.Z", Imf::FLOAT);
  const std::vector<float> velocity = Channel<float>(2, "velocity.Z", Imf::FLOAT);
  const std::vector<std::uint32_t> cell = Channel<std::uint32_t>(3, "cell", Imf::UINT);
  for (const std::size_t i : {Pixel(30, 30), Pixel(50, 30), Pixel(5, 30)}) {
    EXPECT_EQ(z[i], picture_.depth[i]);
    EXPECT_EQ(alpha[i], picture_.rgba[i][3]);
    EXPECT_NEAR(normal[i], picture_.normal[i].z(), 1e-3);
    EXPECT_NEAR(velocity[i], picture_.velocity[i].z(), 2e-3);
    EXPECT_EQ(cell[i], static_cast<std::uint32_t>(picture_.cell[i] + 1));
  }
}

TEST_F(FilmExr, CryptomatteFindsTheNamesInItsManifest) {
  Imf::MultiPartInputFile file((folder_ / "a.exr").c_str());
  std::map<std::string, nlohmann::json> manifests;
  for (auto entry = file.header(4).begin(); entry != file.header(4).end(); ++entry) {
    const std::string name = entry.name();
    if (!name.ends_with("/manifest")) continue;
    const std::string prefix = name.substr(0, name.size() - 8);
    EXPECT_EQ(file.header(4).typedAttribute<Imf::StringAttribute>(prefix + "hash").value(), "MurmurHash3_32");
    manifests[file.header(4).typedAttribute<Imf::StringAttribute>(prefix + "name").value()] =
        nlohmann::json::parse(file.header(4).typedAttribute<Imf::StringAttribute>(prefix + "manifest").value());
  }
  ASSERT_EQ(manifests.size(), 2u);
  EXPECT_TRUE(manifests["CryptoCell"].contains("pendulum"));
  const auto id = [&](const std::string& layer, const std::string& name) {
    return std::bit_cast<float>(static_cast<std::uint32_t>(std::stoul(manifests.at(layer).at(name).get<std::string>(), nullptr, 16)));
  };
  const std::vector<float> cell = Channel<float>(4, "CryptoCell00.R", Imf::FLOAT);
  const std::vector<float> part = Channel<float>(4, "CryptoCell00.G", Imf::FLOAT);
  const std::vector<float> patch = Channel<float>(4, "CryptoPatch00.R", Imf::FLOAT);
  EXPECT_EQ(cell[Pixel(30, 30)], id("CryptoCell", "cell_00000"));
  EXPECT_EQ(cell[Pixel(50, 30)], id("CryptoCell", "cell_00001"));
  EXPECT_EQ(part[Pixel(50, 30)], 1);
  EXPECT_EQ(part[Pixel(5, 30)], 0);
  EXPECT_EQ(patch[Pixel(50, 30)], id("CryptoPatch", "patch_00001"));
}

TEST_F(FilmExr, TheBeautyCanBeReadBackForAPreview) {
  const FilmPicture read = ReadExrBeauty(folder_ / "a.exr").value();
  const Image expected = Develop(picture_);
  const Image image = Develop(read);
  ASSERT_EQ(image.rgb.size(), expected.rgb.size());
  for (std::size_t i = 0; i < image.rgb.size(); ++i) ASSERT_NEAR(image.rgb[i], expected.rgb[i], 1) << i;  // half floats
}

TEST_F(FilmExr, SaysWhatIsNoPicture) {
  EXPECT_EQ(ReadExrBeauty("/nowhere.exr").status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(WriteExr("/nowhere/a.exr", picture_, stage_.camera, stage_.patch, {}).code(), absl::StatusCode::kUnavailable);
}

TEST(FilmColours, ACellTakesTheColourOfThePointsAroundIt) {
  geometry::Cells cells = storage::CubesInARow(2);
  cells.surface = {};
  for (int i = 0; i < 40; ++i) {
    cells.surface.positions.emplace_back(i < 20 ? 0.4 + 0.01 * i : 1.4 + 0.01 * i, 0, 0.5);
    cells.surface.normals.emplace_back(0, -1, 0);
    cells.surface.colours.push_back(i < 20 ? geometry::Rgb8{255, 0, 0} : geometry::Rgb8{0, 0, 255});
  }
  const std::vector<Vec3f> colours = ColoursFromCapture(cells);
  ASSERT_EQ(colours.size(), 2u);
  EXPECT_EQ(colours[0], Vec3f(1, 0, 0));
  EXPECT_EQ(colours[1], Vec3f(0, 0, 1));
  cells.surface.colours.clear();
  EXPECT_TRUE(ColoursFromCapture(cells).empty());
}

}  // namespace
}  // namespace vorocast::rendering
