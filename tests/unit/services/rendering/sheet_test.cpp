// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/sheet.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <numbers>

#include "services/rendering/palette.h"
#include "services/rendering/picture.h"
#include "services/rendering/subjects.h"
#include "tests/unit/services/rendering/sample_shapes.h"

namespace vorocast::rendering {
namespace {

using geometry::CellState;
using geometry::Rgb8;
using geometry::Rigid3;
using geometry::Vec3;
using ::testing::HasSubstr;

PointsPicture Ball(const std::string& label) { return {.points = geometry::SampleSurface(testing::SphereMesh(0.5, 20), 3000, 7), .label = label}; }

Rgb8 PixelAt(const Image& image, std::int32_t column, std::int32_t row) {
  const std::size_t at = 3 * static_cast<std::size_t>(row * image.width + column);
  return {image.rgb[at], image.rgb[at + 1], image.rgb[at + 2]};
}

TEST(RenderSheet, PlacesPicturesInReadingOrderAboveTheirLabels) {
  // Six square pictures of 96 pixels: three a row, as near to 3:2 as can be.
  std::vector<PointsPicture> pictures(6, Ball(""));
  const SheetLayout layout{.picture_width = 96, .title = "six", .shrink = 0.9, .azimuth_deg = 0};
  const auto sheet = RenderSheet(pictures, layout, {});
  ASSERT_TRUE(sheet.ok()) << sheet.status();
  EXPECT_EQ(sheet->rgb.size(), 3 * static_cast<std::size_t>(sheet->width) * static_cast<std::size_t>(sheet->height));
  EXPECT_EQ(sheet->width, 4 + 3 * (96 + 4));
  // Every label is below its picture, and changes nothing else.
  std::vector<PointsPicture> labelled = pictures;
  labelled[4].label = "frame 4";
  const auto with_label = RenderSheet(labelled, layout, {});
  ASSERT_TRUE(with_label.ok());
  std::int32_t changed = 0;
  std::int32_t first_row = sheet->height;
  std::int32_t last_row = 0;
  for (std::int32_t row = 0; row < sheet->height; ++row) {
    for (std::int32_t column = 0; column < sheet->width; ++column) {
      if (PixelAt(*sheet, column, row) == PixelAt(*with_label, column, row)) continue;
      ++changed;
      first_row = std::min(first_row, row);
      last_row = std::max(last_row, row);
      EXPECT_GE(column, 4 + 100);  // the second column of the second row
      EXPECT_LT(column, 4 + 196);
    }
  }
  EXPECT_GT(changed, 20);
  EXPECT_GE(first_row, sheet->height - 16);
  EXPECT_LT(last_row, sheet->height);
}

TEST(RenderSheet, ShowsTheBackdropInTheCornersOfEachPicture) {
  const SheetLayout layout{.picture_width = 96, .title = "", .shrink = 0.9, .azimuth_deg = 0};
  const auto sheet = RenderSheet(std::vector<PointsPicture>{Ball("ball")}, layout, {});
  ASSERT_TRUE(sheet.ok()) << sheet.status();
  const std::int32_t height = sheet->height - 4 - 16;
  for (std::int32_t column : {4, 4 + 95}) EXPECT_EQ(PixelAt(*sheet, column, 4), Backdrop(0, height));
}

TEST(RenderSheet, GivesTheSameBytesTwice) {
  const geometry::Cells cells = testing::CubeCells(3, 6, 2, 0.25);
  const geometry::TriangleMesh ball = testing::SphereMesh(0.2, 10);
  CellsPicture picture{.cells = &cells, .label = "cells"};
  picture.objects.emplace_back(&ball, Rigid3{.rotation = geometry::Quat::Identity(), .translation = Vec3(0.7, 1, 0)});
  const SheetLayout layout{.picture_width = 120, .title = "twice"};
  const auto first = RenderSheet(std::vector<CellsPicture>{picture, picture}, layout, {});
  const auto second = RenderSheet(std::vector<CellsPicture>{picture, picture}, layout, {});
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(first->rgb, second->rgb);
  // Both pictures are the same: one camera, one light, one noise.
  for (std::int32_t row = 40; row < 100; ++row) {
    for (std::int32_t column = 4; column < 124; ++column) ASSERT_EQ(PixelAt(*first, column, row), PixelAt(*first, column + 124, row));
  }
}

TEST(RenderSheet, ReportsProgressToTheEnd) {
  std::vector<double> reported;
  ASSERT_TRUE(
      RenderSheet(std::vector<PointsPicture>(2, Ball("")), {.picture_width = 32}, [&](double fraction) { reported.push_back(fraction); }).ok());
  EXPECT_TRUE(std::ranges::is_sorted(reported));
  EXPECT_EQ(reported.back(), 1);
}

TEST(RenderSheet, RefusesWhatItCannotDraw) {
  const auto error = [](const auto& pictures, const SheetLayout& layout) {
    return std::string(RenderSheet(pictures, layout, {}).status().message());
  };
  EXPECT_THAT(error(std::vector<PointsPicture>{}, {}), HasSubstr("at least one picture"));
  EXPECT_THAT(error(std::vector<PointsPicture>(1), {}), HasSubstr("nothing to draw"));
  EXPECT_THAT(error(std::vector<PointsPicture>{Ball("")}, {.picture_width = 4}), HasSubstr("4 pixels wide"));
  EXPECT_THAT(error(std::vector<PointsPicture>{Ball("")}, {.shrink = 0}), HasSubstr("shrink"));
  EXPECT_THAT(error(std::vector<PointsPicture>{Ball("")}, {.elevation_deg = 95}), HasSubstr("elevation"));
  EXPECT_THAT(error(std::vector<PointsPicture>(100, Ball("")), {.picture_width = 8000}), HasSubstr("too large"));
  PointsPicture bare = Ball("");
  bare.points.normals.clear();
  EXPECT_THAT(error(std::vector<PointsPicture>{Ball(""), bare}, {}), HasSubstr("picture 1: 3000 points have 0 normals"));
  PointsPicture lost = Ball("");
  lost.points.positions[5].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(error(std::vector<PointsPicture>{lost}, {}), HasSubstr("not finite"));

  const geometry::Cells cells = testing::CubeCells(2, 2, 2, 0.5);
  CellsPicture picture{.cells = &cells};
  picture.world_from_template.resize(3);
  EXPECT_THAT(error(std::vector<CellsPicture>{picture}, {}), HasSubstr("8 cells have 3 poses"));
  picture.world_from_template.resize(8);
  picture.world_from_template[6].translation.y() = std::numeric_limits<double>::infinity();
  EXPECT_THAT(error(std::vector<CellsPicture>{picture}, {}), HasSubstr("the pose of cell 6"));
  picture.world_from_template.clear();
  picture.state.assign(8, CellState::kGone);
  EXPECT_THAT(error(std::vector<CellsPicture>{picture}, {}), HasSubstr("nothing to draw"));
}

TEST(MakeMeshes, DrawsCellsShrunkPosedAndColoured) {
  const geometry::Cells cells = testing::CubeCells(2, 1, 1, 1);
  const std::vector<std::int32_t> patch = {4, 5};
  CellsPicture picture{.cells = &cells, .patch = &patch};
  picture.world_from_template.resize(2);
  picture.world_from_template[1].translation = Vec3(10, 0, 0);
  picture.state = {CellState::kRecalled, CellState::kReleased};
  const auto meshes = MakeMeshes(picture, 0.5);
  ASSERT_EQ(meshes.size(), 1U);
  ASSERT_EQ(meshes[0].colours.size(), 24U);  // two cubes of six faces of two triangles
  Eigen::AlignedBox3f first;
  Eigen::AlignedBox3f second;
  for (std::size_t i = 0; i < 72; ++i) (i < 36 ? first : second).extend(meshes[0].corners[i]);
  EXPECT_NEAR((first.min() - geometry::Vec3f(-0.75F, 0.25F, -0.25F)).norm(), 0, 1e-6);
  EXPECT_NEAR((first.max() - geometry::Vec3f(-0.25F, 0.75F, 0.25F)).norm(), 0, 1e-6);
  EXPECT_NEAR((second.min() - geometry::Vec3f(10.25F, 0.25F, -0.25F)).norm(), 0, 1e-5);
  // Triangles turn outward: the signed volume of each cube is half its side cubed.
  double volume = 0;
  for (std::size_t i = 0; i < 36; i += 3) {
    volume += static_cast<double>(meshes[0].corners[i].dot(meshes[0].corners[i + 1].cross(meshes[0].corners[i + 2]))) / 6;
  }
  EXPECT_NEAR(volume, 0.125, 1e-6);
  // One cut face a cell, where the two touch: darker than the skin.
  int cut = 0;
  for (std::size_t i = 0; i < 12; ++i) cut += meshes[0].colours[i].sum() < PatchColour(4).sum() ? 1 : 0;
  EXPECT_EQ(cut, 2);
  picture.state[0] = CellState::kGone;
  EXPECT_EQ(MakeMeshes(picture, 0.5)[0].colours.size(), 12U);
}

TEST(MakeDiscs, CloseTheSurfaceWithoutGrowingBeyondIt) {
  const PointsPicture ball = Ball("");
  const std::vector<Disc> discs = MakeDiscs(ball.points);
  ASSERT_EQ(discs.size(), 3000U);
  double area = 0;
  for (const Disc& disc : discs) area += std::numbers::pi * static_cast<double>(disc.radius * disc.radius);
  const double sphere = 4 * std::numbers::pi * 0.25;
  EXPECT_GT(area, 1.5 * sphere);  // random points leave holes unless discs overlap
  EXPECT_LT(area, 6 * sphere);
}

TEST(PatchColour, NeighbouringIndicesDiffer) {
  for (std::int32_t i = 0; i < 300; ++i) EXPECT_GT((PatchColour(i) - PatchColour(i + 1)).norm(), 0.15) << i;
  for (std::uint32_t i = 0; i < 256; ++i) {
    const auto level = static_cast<std::uint8_t>(i);
    EXPECT_EQ(Rgb8FromLinear(LinearFromRgb8({level, level, level}))[1], level);
  }
}

/// What libpng itself finds in a file.
Image ReadBack(const std::filesystem::path& path) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_file(&png, path.c_str()), 0) << png.message;
  png.format = PNG_FORMAT_RGB;
  Image image{.width = static_cast<std::int32_t>(png.width), .height = static_cast<std::int32_t>(png.height), .rgb = {}};
  image.rgb.resize(PNG_IMAGE_SIZE(png));
  EXPECT_NE(png_image_finish_read(&png, nullptr, image.rgb.data(), 0, nullptr), 0) << png.message;
  return image;
}

std::string Bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(WritePng, IsReadBackTheSameAndHasTheSameBytesTwice) {
  Image image{.width = 37, .height = 23, .rgb = {}};
  for (std::int32_t i = 0; i < 3 * 37 * 23; ++i) image.rgb.push_back(static_cast<std::uint8_t>((i * i) % 251));
  const std::filesystem::path first = std::filesystem::path(::testing::TempDir()) / "vorocast_write_png_1.png";
  const std::filesystem::path second = std::filesystem::path(::testing::TempDir()) / "vorocast_write_png_2.png";
  ASSERT_TRUE(WritePng(first, image).ok());
  ASSERT_TRUE(WritePng(second, image).ok());
  const Image back = ReadBack(first);
  EXPECT_EQ(back.width, 37);
  EXPECT_EQ(back.height, 23);
  EXPECT_EQ(back.rgb, image.rgb);
  EXPECT_EQ(Bytes(first), Bytes(second));
  std::filesystem::remove(first);
  std::filesystem::remove(second);
  EXPECT_THAT(std::string(WritePng("/nowhere/at/all.png", image).message()), HasSubstr("/nowhere/at/all.png: cannot be written"));
}

}  // namespace
}  // namespace vorocast::rendering
