// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/interchange/point_cache.h"

#include <bit>
#include <cstring>
#include <fstream>
#include <iterator>

#include <assimp/scene.h>
#include <gtest/gtest.h>
#include <assimp/Importer.hpp>
#include "tests/unit/services/interchange/sample_moving_cells.h"
#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::interchange {
namespace {

using geometry::Vec3;

constexpr std::size_t kVertices = 24;  // of three cubes

std::string Bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The four bytes at `offset`, of a big- or little-endian file.
template <typename Value>
Value At(const std::string& bytes, std::size_t offset, std::endian order) {
  char raw[4];
  for (std::size_t i = 0; i < 4; ++i) raw[i] = bytes.at(offset + (order == std::endian::native ? i : 3 - i));
  Value value;
  std::memcpy(&value, raw, 4);
  return value;
}

Vec3 Point(const std::string& bytes, std::size_t offset, std::endian order) {
  return {At<float>(bytes, offset, order), At<float>(bytes, offset + 4, order), At<float>(bytes, offset + 8, order)};
}

/// Each vertex of the cache lies where the pose puts the mesh's vertex of the same number.
void ExpectMotion(const MovingCells& take, const std::string& bytes, std::size_t first, std::endian order) {
  for (std::size_t s = 0; s < take.instant_count(); ++s) {
    std::size_t v = 0;
    for (std::size_t cell = 0; cell < take.cell_count(); ++cell) {
      const CellShape shape = ShapeOfCell(take.model.cells, cell);
      for (const Vec3& vertex : shape.vertices) {
        const Vec3 expected = take.State(s, cell) == geometry::CellState::kGone ? take.Pose(s, cell) * take.model.cells.centroid[cell]
                                                                                : take.Pose(s, cell) * (take.model.cells.centroid[cell] + vertex);
        EXPECT_LT((Point(bytes, first + 12 * (s * kVertices + v++), order) - expected).norm(), 1e-5);
      }
    }
    EXPECT_EQ(v, kVertices);
  }
}

// The layouts are those of the formats' public descriptions: 3ds Max's PC2 and LightWave's MDD.
TEST(PointCache, Pc2) {
  const TemporaryFolder folder;
  const MovingCells take = ThreeCubesMoving();
  ASSERT_EQ(WritePointCache(take, PointCache::kPc2, folder / "take.pc2", {}), absl::OkStatus());
  const std::string bytes = Bytes(folder / "take.pc2");
  ASSERT_EQ(bytes.size(), 32 + 12 * 3 * kVertices);
  EXPECT_EQ(bytes.substr(0, 12), std::string("POINTCACHE2\0", 12));
  EXPECT_EQ(At<std::int32_t>(bytes, 12, std::endian::little), 1);
  EXPECT_EQ(At<std::int32_t>(bytes, 16, std::endian::little), 24);
  EXPECT_EQ(At<float>(bytes, 20, std::endian::little), 0);
  EXPECT_FLOAT_EQ(At<float>(bytes, 24, std::endian::little), 1.5);  // three samples over three frames
  EXPECT_EQ(At<std::int32_t>(bytes, 28, std::endian::little), 3);
  ExpectMotion(take, bytes, 32, std::endian::little);
}

TEST(PointCache, Mdd) {
  const TemporaryFolder folder;
  const MovingCells take = ThreeCubesMoving();
  ASSERT_EQ(WritePointCache(take, PointCache::kMdd, folder / "take.mdd", {}), absl::OkStatus());
  const std::string bytes = Bytes(folder / "take.mdd");
  ASSERT_EQ(bytes.size(), 8 + 4 * 3 + 12 * 3 * kVertices);
  EXPECT_EQ(At<std::int32_t>(bytes, 0, std::endian::big), 3);
  EXPECT_EQ(At<std::int32_t>(bytes, 4, std::endian::big), 24);
  EXPECT_FLOAT_EQ(At<float>(bytes, 16, std::endian::big), 0.06F);
  ExpectMotion(take, bytes, 20, std::endian::big);
}

TEST(PointCache, TheMeshBesideItHasItsVerticesInTheCachesOrder) {
  const TemporaryFolder folder;
  const MovingCells take = ThreeCubesMoving();
  ASSERT_EQ(WritePointCache(take, PointCache::kPc2, folder / "take.pc2", {}), absl::OkStatus());
  const std::string bytes = Bytes(folder / "take.pc2");
  std::ifstream obj(folder / "take.obj");
  std::size_t v = 0;
  for (std::string line; std::getline(obj, line);) {
    Vec3 x;
    if (std::sscanf(line.c_str(), "v %lf %lf %lf", &x[0], &x[1], &x[2]) == 3) {
      EXPECT_LT((x - Point(bytes, 32 + 12 * v++, std::endian::little)).norm(), 1e-5);
    }
  }
  EXPECT_EQ(v, kVertices);
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile((folder / "take.obj").string(), 0);
  ASSERT_NE(scene, nullptr) << importer.GetErrorString();
  unsigned faces = 0;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) faces += scene->mMeshes[m]->mNumFaces;
  EXPECT_EQ(faces, 18u);
}

}  // namespace
}  // namespace vorocast::interchange
