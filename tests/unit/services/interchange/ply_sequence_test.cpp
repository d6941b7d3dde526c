// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/interchange/ply_sequence.h"

#include <assimp/scene.h>
#include <gtest/gtest.h>
#include <assimp/Importer.hpp>
#include "tests/unit/services/interchange/sample_moving_cells.h"
#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::interchange {
namespace {

struct Surface {
  unsigned faces = 0;
  double area = 0;
  Eigen::AlignedBox3d box;
};

Surface Read(const std::filesystem::path& path) {
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(path.string(), 0);
  EXPECT_NE(scene, nullptr) << importer.GetErrorString();
  if (!scene) return {};
  Surface surface;
  const auto at = [&](const aiMesh* mesh, unsigned i) { return geometry::Vec3(mesh->mVertices[i].x, mesh->mVertices[i].y, mesh->mVertices[i].z); };
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh* mesh = scene->mMeshes[m];
    surface.faces += mesh->mNumFaces;
    for (unsigned f = 0; f < mesh->mNumFaces; ++f) {
      const aiFace& face = mesh->mFaces[f];
      for (unsigned i = 0; i < face.mNumIndices; ++i) surface.box.extend(at(mesh, face.mIndices[i]));
      for (unsigned i = 1; i + 1 < face.mNumIndices; ++i) {
        const geometry::Vec3 a = at(mesh, face.mIndices[0]);
        surface.area += (at(mesh, face.mIndices[i]) - a).cross(at(mesh, face.mIndices[i + 1]) - a).norm() / 2;
      }
    }
  }
  return surface;
}

TEST(PlySequence, ShowsSkinAndOpenCutsOnly) {
  const TemporaryFolder folder;
  const MovingCells take = ThreeCubesMoving();
  ASSERT_EQ(WritePlySequence(take, folder / "sequence", {}), absl::OkStatus());

  // All three hold together: a bar of 3 × 1 × 1.
  const Surface together = Read(folder / "sequence/cells_000000.ply");
  EXPECT_EQ(together.faces, 14u);
  EXPECT_NEAR(together.area, 14, 1e-5);
  // The middle one is released: its two cuts open on both sides.
  const Surface apart = Read(folder / "sequence/cells_000001.ply");
  EXPECT_EQ(apart.faces, 18u);
  EXPECT_NEAR(apart.area, 18, 1e-5);
  // The last one is gone.
  EXPECT_EQ(Read(folder / "sequence/cells_000002.ply").faces, 12u);
}

TEST(PlySequence, PutsCellsWhereTheirPosesSay) {
  const TemporaryFolder folder;
  MovingCells take = ThreeCubesMoving();
  ASSERT_EQ(WritePlySequence(take, folder / "sequence", {}), absl::OkStatus());
  Eigen::AlignedBox3d expected;
  for (std::size_t cell = 0; cell < 3; ++cell) {
    for (int corner = 0; corner < 8; ++corner) {
      expected.extend(take.Pose(1, cell) * geometry::Vec3(static_cast<double>(cell) + (corner & 1), (corner >> 1) & 1, corner >> 2));
    }
  }
  const Surface surface = Read(folder / "sequence/cells_000001.ply");
  EXPECT_LT((surface.box.min() - expected.min()).norm() + (surface.box.max() - expected.max()).norm(), 1e-5);
}

}  // namespace
}  // namespace vorocast::interchange
