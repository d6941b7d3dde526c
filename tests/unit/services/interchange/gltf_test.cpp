// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/interchange/gltf.h"

#include <map>

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <gtest/gtest.h>
#include <assimp/Importer.hpp>
#include "tests/unit/services/interchange/sample_moving_cells.h"
#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::interchange {
namespace {

using geometry::Vec3;

Vec3 ToVec3(const aiVector3D& v) { return {v.x, v.y, v.z}; }
geometry::Quat ToQuat(const aiQuaternion& q) { return {q.w, q.x, q.y, q.z}; }

class Gltf : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(WriteGltf(take_, folder_ / "take.glb", {}), absl::OkStatus());
    scene_ = importer_.ReadFile((folder_ / "take.glb").string(), aiProcess_ValidateDataStructure);
    ASSERT_NE(scene_, nullptr) << importer_.GetErrorString();
    ASSERT_EQ(scene_->mNumAnimations, 1u);
    for (unsigned i = 0; i < scene_->mAnimations[0]->mNumChannels; ++i) {
      const aiNodeAnim* channel = scene_->mAnimations[0]->mChannels[i];
      channels_[channel->mNodeName.C_Str()] = channel;
    }
  }

  TemporaryFolder folder_;
  MovingCells take_ = ThreeCubesMoving();
  Assimp::Importer importer_;
  const aiScene* scene_ = nullptr;
  std::map<std::string, const aiNodeAnim*> channels_;
};

TEST_F(Gltf, EachCellIsANodeWithItsClosedPolyhedron) {
  for (int cell = 0; cell < 3; ++cell) {
    const aiNode* node = scene_->mRootNode->FindNode(("cell_0000" + std::to_string(cell)).c_str());
    ASSERT_NE(node, nullptr);
    // Volume by the divergence theorem about the centroid: a unit cube, whose corners are half a side away.
    double volume = 0;
    for (unsigned m = 0; m < node->mNumMeshes; ++m) {
      const aiMesh* mesh = scene_->mMeshes[node->mMeshes[m]];
      const std::string material = scene_->mMaterials[mesh->mMaterialIndex]->GetName().C_Str();
      const unsigned cuts = cell == 1 ? 2 : 1;
      EXPECT_EQ(mesh->mNumFaces, material == "cut" ? 2 * cuts : 2 * (6 - cuts)) << material;
      for (unsigned f = 0; f < mesh->mNumFaces; ++f) {
        const unsigned* i = mesh->mFaces[f].mIndices;
        const Vec3 a = ToVec3(mesh->mVertices[i[0]]), b = ToVec3(mesh->mVertices[i[1]]), c = ToVec3(mesh->mVertices[i[2]]);
        EXPECT_NEAR(a.cwiseAbs().maxCoeff(), 0.5, 1e-6);
        EXPECT_NEAR((b - a).cross(c - a).normalized().dot(ToVec3(mesh->mNormals[i[0]])), 1, 1e-6);
        volume += a.dot(b.cross(c)) / 6;
      }
    }
    EXPECT_NEAR(volume, 1, 1e-6);
  }
}

TEST_F(Gltf, NodesFollowTheCellsPoses) {
  for (std::size_t cell = 1; cell < 3; ++cell) {
    const aiNodeAnim* channel = channels_.at("cell_0000" + std::to_string(cell));
    ASSERT_EQ(channel->mNumPositionKeys, 3u);
    ASSERT_EQ(channel->mNumRotationKeys, 3u);
    const double ticks = scene_->mAnimations[0]->mTicksPerSecond;
    for (unsigned s = 0; s < 3; ++s) {
      EXPECT_NEAR(channel->mPositionKeys[s].mTime / ticks, take_.time[s], 1e-6);
      // Any point of the cell, moved by the file and by the take.
      const Vec3 x = take_.model.cells.centroid[cell] + Vec3(0.5, -0.5, 0.25);
      const Vec3 moved = ToQuat(channel->mRotationKeys[s].mValue) * (x - take_.model.cells.centroid[cell]) + ToVec3(channel->mPositionKeys[s].mValue);
      EXPECT_LT((moved - take_.Pose(s, cell) * x).norm(), 1e-5);
      if (s > 0) {
        EXPECT_GE(ToQuat(channel->mRotationKeys[s].mValue).dot(ToQuat(channel->mRotationKeys[s - 1].mValue)), 0);
      }
    }
  }
}

TEST_F(Gltf, WhatStandsStillHasNoChannel) { EXPECT_FALSE(channels_.contains("cell_00000")); }

TEST_F(Gltf, GoneCellsAreScaledToNothing) {
  const aiNodeAnim* channel = channels_.at("cell_00002");
  ASSERT_EQ(channel->mNumScalingKeys, 3u);
  EXPECT_EQ(ToVec3(channel->mScalingKeys[1].mValue), Vec3(1, 1, 1));
  EXPECT_EQ(ToVec3(channel->mScalingKeys[2].mValue), Vec3(0, 0, 0));
}

TEST(GltfFile, CellsShrinkLittleByLittle) {
  const TemporaryFolder folder;
  MovingCells take = ThreeCubesMoving();
  take.scale = {1, 1, 1, 1, 0.5F, 1, 1, 0.25F, 1};
  ASSERT_EQ(WriteGltf(take, folder / "take.glb", {}), absl::OkStatus());
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile((folder / "take.glb").string(), 0);
  ASSERT_NE(scene, nullptr);
  for (unsigned i = 0; i < scene->mAnimations[0]->mNumChannels; ++i) {
    const aiNodeAnim* channel = scene->mAnimations[0]->mChannels[i];
    if (std::string(channel->mNodeName.C_Str()) != "cell_00001") continue;
    ASSERT_EQ(channel->mNumScalingKeys, 3u);
    EXPECT_EQ(ToVec3(channel->mScalingKeys[1].mValue), Vec3(0.5, 0.5, 0.5));
    EXPECT_EQ(ToVec3(channel->mScalingKeys[2].mValue), Vec3(0.25, 0.25, 0.25));
  }
}

TEST_F(Gltf, SceneObjectsMoveToo) {
  const aiNode* ball = scene_->mRootNode->FindNode("ball");
  ASSERT_NE(ball, nullptr);
  EXPECT_EQ(scene_->mMeshes[ball->mMeshes[0]]->mNumFaces, 4u);
  EXPECT_EQ(ToVec3(channels_.at("ball")->mPositionKeys[2].mValue), Vec3(4, 2, 0));
}

TEST(GltfFile, SaysWhereItCannotWrite) {
  const absl::Status status = WriteGltf(ThreeCubesMoving(), "/nowhere/take.glb", {});
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_NE(std::string(status.message()).find("/nowhere/take.glb"), std::string::npos);
}

}  // namespace
}  // namespace vorocast::interchange
