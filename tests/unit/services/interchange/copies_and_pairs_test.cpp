// SPDX-License-Identifier: AGPL-3.0-or-later
// Copies, cells that turn into another take's, and cells that shrink, in every format: where a reader finds them is where the take's own numbers
// put them, worked out apart from the exporters.
#include <algorithm>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <sstream>

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <assimp/Importer.hpp>
#include "services/interchange/gltf.h"
#include "services/interchange/pieces.h"
#include "services/interchange/ply_sequence.h"
#include "services/interchange/point_cache.h"
#include "services/interchange/usd.h"
#include "tests/unit/services/interchange/sample_moving_cells.h"
#include "tests/unit/services/storage/temporary_folder.h"

namespace vorocast::interchange {
namespace {

using geometry::Vec3;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kNear = 2e-5;  // single precision a few units from the origin

Vec3 ToVec3(const aiVector3D& v) { return {v.x, v.y, v.z}; }

/// Each point of one list has one of the other near it, and the other way round. Importers order and double vertices as they like.
void ExpectSamePlaces(const std::vector<Vec3>& found, const std::vector<Vec3>& expected, const std::string& what) {
  const auto all_near = [](const std::vector<Vec3>& points, const std::vector<Vec3>& others) {
    return std::ranges::all_of(points,
                               [&](const Vec3& x) { return std::ranges::any_of(others, [&](const Vec3& y) { return (x - y).norm() < kNear; }); });
  };
  EXPECT_FALSE(found.empty()) << what;
  EXPECT_TRUE(all_near(found, expected)) << what;
  EXPECT_TRUE(all_near(expected, found)) << what;
}

std::map<std::string, std::vector<Vec3>> CornersByName(const MovingCells& take, std::size_t instant) {
  std::map<std::string, std::vector<Vec3>> corners;
  for (const PlacedShape& shape : EverythingAt(take, instant)) corners[shape.name] = shape.corners;
  return corners;
}

TEST(CopiesAndPairs, AreNamedInOrder) {
  std::vector<std::string> names;
  for (const Piece& piece : PiecesOf(ThreeCubesWithCopiesAndPairs())) names.push_back(piece.Name());
  EXPECT_THAT(names, ElementsAre("cell_00000", "cell_00001", "cell_00002", "copy_000_cell_00000", "copy_000_cell_00002", "copy_004_cell_00001",
                                 "pair_00000", "pair_00001"));
}

TEST(CopiesAndPairs, EveryNthInstantKeepsItsCopiesAndPairs) {
  const MovingCells whole = ThreeCubesWithCopiesAndPairs();
  MovingCells take = whole;
  KeepEvery(2, take);
  const auto kept = CornersByName(take, 1);
  EXPECT_EQ(kept, CornersByName(whole, 2));
  EXPECT_EQ(kept.count("copy_004_cell_00001"), 1u);
  EXPECT_EQ(CornersByName(take, 0), CornersByName(whole, 0));
}

/// A key of the last instant that is not after `time`, as a player that stands on a key finds it; before the first, that.
template <typename Key>
const Key& KeyAt(const Key* keys, unsigned count, double time) {
  unsigned at = 0;
  while (at + 1 < count && keys[at + 1].mTime <= time + 1e-3) ++at;
  return keys[at];
}

TEST(CopiesAndPairs, GltfThroughAssimp) {
  const TemporaryFolder folder;
  const MovingCells take = ThreeCubesWithCopiesAndPairs();
  ASSERT_EQ(WriteGltf(take, folder / "take.glb", {}), absl::OkStatus());
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile((folder / "take.glb").string(), aiProcess_ValidateDataStructure);
  ASSERT_NE(scene, nullptr) << importer.GetErrorString();
  const aiAnimation* animation = scene->mAnimations[0];
  std::map<std::string, const aiNodeAnim*> channels;
  std::map<std::string, const aiMeshMorphAnim*> weights;
  for (unsigned i = 0; i < animation->mNumChannels; ++i) channels[animation->mChannels[i]->mNodeName.C_Str()] = animation->mChannels[i];
  for (unsigned i = 0; i < animation->mNumMorphMeshChannels; ++i)
    weights[animation->mMorphMeshChannels[i]->mName.C_Str()] = animation->mMorphMeshChannels[i];

  for (std::size_t s = 0; s < 3; ++s) {
    const double ticks = take.time[s] * animation->mTicksPerSecond;
    const auto expected = CornersByName(take, s);
    std::set<std::string> shown;
    for (unsigned child = 0; child < scene->mRootNode->mNumChildren; ++child) {
      const aiNode* node = scene->mRootNode->mChildren[child];
      const std::string name = node->mName.C_Str();
      if (name == "ball") continue;
      aiVector3D scaling, position;
      aiQuaternion rotation;
      node->mTransformation.Decompose(scaling, rotation, position);
      if (const auto found = channels.find(name); found != channels.end()) {
        const aiNodeAnim& channel = *found->second;
        if (channel.mNumPositionKeys > 0) position = KeyAt(channel.mPositionKeys, channel.mNumPositionKeys, ticks).mValue;
        if (channel.mNumRotationKeys > 0) rotation = KeyAt(channel.mRotationKeys, channel.mNumRotationKeys, ticks).mValue;
        if (channel.mNumScalingKeys > 0) scaling = KeyAt(channel.mScalingKeys, channel.mNumScalingKeys, ticks).mValue;
      }
      if (scaling.x == 0) continue;
      shown.insert(name);
      ASSERT_EQ(expected.count(name), 1u) << name << " at instant " << s;
      double weight = 0;
      if (const auto found = weights.find(name); found != weights.end())
        weight = KeyAt(found->second->mKeys, found->second->mNumKeys, ticks).mWeights[0];
      std::vector<Vec3> corners;
      for (unsigned m = 0; m < node->mNumMeshes; ++m) {
        const aiMesh* mesh = scene->mMeshes[node->mMeshes[m]];
        for (unsigned v = 0; v < mesh->mNumVertices; ++v) {
          Vec3 x = ToVec3(mesh->mVertices[v]);
          if (mesh->mNumAnimMeshes > 0) x += weight * (ToVec3(mesh->mAnimMeshes[0]->mVertices[v]) - x);
          corners.push_back(geometry::Quat(rotation.w, rotation.x, rotation.y, rotation.z).normalized() * (static_cast<double>(scaling.x) * x) +
                            ToVec3(position));
        }
      }
      ExpectSamePlaces(corners, expected.at(name), name + " at instant " + std::to_string(s));
    }
    for (const auto& [name, corners] : expected) EXPECT_TRUE(shown.contains(name)) << name << " at instant " << s;
  }
}

TEST(CopiesAndPairs, GltfNormalsOfWhatGrowsFromNothingPointOutwards) {
  const TemporaryFolder folder;
  ASSERT_EQ(WriteGltf(ThreeCubesWithCopiesAndPairs(), folder / "take.glb", {}), absl::OkStatus());
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile((folder / "take.glb").string(), 0);
  ASSERT_NE(scene, nullptr) << importer.GetErrorString();
  const aiNode* node = scene->mRootNode->FindNode("pair_00001");
  ASSERT_NE(node, nullptr);
  const aiMesh* mesh = scene->mMeshes[node->mMeshes[0]];
  ASSERT_EQ(mesh->mNumFaces, 4u);
  for (unsigned f = 0; f < 4; ++f) {
    const Vec3 inside(0.2, 0.2, 0.2);  // of the tetrahedron with the corners 0, x, 2 y, 3 z
    const unsigned corner = mesh->mFaces[f].mIndices[0];
    EXPECT_GT(ToVec3(mesh->mNormals[corner]).dot(ToVec3(mesh->mAnimMeshes[0]->mVertices[corner]) - inside), 0.1);
    EXPECT_NEAR(ToVec3(mesh->mNormals[corner]).norm(), 1, 1e-6);
  }
}

TEST(CopiesAndPairs, PlyThroughAssimp) {
  const TemporaryFolder folder;
  const MovingCells take = ThreeCubesWithCopiesAndPairs();
  ASSERT_EQ(WritePlySequence(take, folder / "sequence", {}), absl::OkStatus());
  // Faces: at first all three hold together; then the second is released; all three are smaller or alone at last. Every copy has six, every pair
  // four.
  const unsigned faces[] = {14, 18 + 12 + 4, 12 + 12 + 8};
  for (std::size_t s = 0; s < 3; ++s) {
    Assimp::Importer importer;
    const aiScene* scene = importer.ReadFile((folder / ("sequence/cells_00000" + std::to_string(s) + ".ply")).string(), 0);
    ASSERT_NE(scene, nullptr) << importer.GetErrorString();
    std::vector<Vec3> found, expected;
    unsigned count = 0;
    for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
      count += scene->mMeshes[m]->mNumFaces;
      for (unsigned v = 0; v < scene->mMeshes[m]->mNumVertices; ++v) found.push_back(ToVec3(scene->mMeshes[m]->mVertices[v]));
    }
    for (const PlacedShape& shape : EverythingAt(take, s)) expected.insert(expected.end(), shape.corners.begin(), shape.corners.end());
    EXPECT_EQ(count, faces[s]) << s;
    ExpectSamePlaces(found, expected, "instant " + std::to_string(s));
  }
}

TEST(CopiesAndPairs, PlyCutsOpenWhereACellShrinks) {
  const TemporaryFolder folder;
  MovingCells take = ThreeCubesMoving();
  std::ranges::fill(take.state, geometry::CellState::kRecalled);
  take.scale.assign(9, 1);
  take.scale[3] = 0.5F;  // the first cube at the second instant: both sides of its one cut
  ASSERT_EQ(WritePlySequence(take, folder / "sequence", {}), absl::OkStatus());
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile((folder / "sequence/cells_000001.ply").string(), 0);
  ASSERT_NE(scene, nullptr);
  EXPECT_EQ(scene->mMeshes[0]->mNumFaces, 16u);
}

TEST(CopiesAndPairs, PointCacheKeepsItsVerticesAndHidesWhatIsNotThereInPoints) {
  const TemporaryFolder folder;
  const MovingCells take = ThreeCubesWithCopiesAndPairs();
  ASSERT_EQ(WritePointCache(take, PointCache::kPc2, folder / "take.pc2", {}), absl::OkStatus());
  std::ifstream file(folder / "take.pc2", std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  const std::vector<std::pair<std::string, std::size_t>> order = {{"cell_00000", 8},          {"cell_00001", 8},          {"cell_00002", 8},
                                                                  {"copy_000_cell_00000", 8}, {"copy_000_cell_00002", 8}, {"copy_004_cell_00001", 8},
                                                                  {"pair_00000", 4},          {"pair_00001", 4}};
  constexpr std::size_t kVertices = 56;
  ASSERT_EQ(bytes.size(), 32 + 3 * 12 * kVertices);
  for (std::size_t s = 0; s < 3; ++s) {
    auto expected = CornersByName(take, s);
    std::size_t at = 32 + s * 12 * kVertices;
    for (const auto& [name, count] : order) {
      std::vector<Vec3> corners;
      for (std::size_t v = 0; v < count; ++v, at += 12) {
        float x[3];
        std::memcpy(x, bytes.data() + at, 12);
        corners.emplace_back(x[0], x[1], x[2]);
      }
      if (expected.contains(name)) {
        for (std::size_t v = 0; v < count; ++v) EXPECT_LT((corners[v] - expected[name][v]).norm(), kNear) << name << " at instant " << s;
      } else {
        for (const Vec3& corner : corners) EXPECT_LT((corner - corners[0]).norm(), kNear) << name << " at instant " << s;
      }
    }
  }
  // The mesh that it moves: groups in the same order, with as many vertices.
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile((folder / "take.obj").string(), 0);
  ASSERT_NE(scene, nullptr) << importer.GetErrorString();
  unsigned faces = 0;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) faces += scene->mMeshes[m]->mNumFaces;
  EXPECT_EQ(faces, 6u * 6 + 2 * 4);
  std::ifstream obj(folder / "take.obj");
  std::vector<std::pair<std::string, std::size_t>> groups;
  for (std::string line; std::getline(obj, line);) {
    if (line.starts_with("g ")) groups.emplace_back(line.substr(2), 0);
    if (line.starts_with("v ")) ++groups.back().second;
  }
  EXPECT_EQ(groups, order);
}

class UsdWithCopies : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(WriteUsd(take_, folder_ / "take.usda", {}), absl::OkStatus());
    std::ostringstream text;
    text << std::ifstream(folder_ / "take.usda").rdbuf();
    text_ = text.str();
  }
  /// The text of one prim, from its name on.
  std::string Prim(const std::string& name) const {
    const std::size_t begin = text_.find("    def " + name);
    return begin == std::string::npos ? "" : text_.substr(begin, text_.find("\n    }\n", begin) - begin);
  }
  /// All numbers of an attribute's sample.
  static std::vector<double> Sample(const std::string& prim, const std::string& attribute, const std::string& code) {
    const std::size_t samples = prim.find(attribute + ".timeSamples = {");
    const std::size_t line = prim.find(" " + code + ": ", samples);
    if (samples == std::string::npos || line > prim.find("}\n", samples)) return {};
    std::string text = prim.substr(line + code.size() + 3, prim.find('\n', line) - line - code.size() - 3);
    for (char& c : text) {
      if (c == '(' || c == ')' || c == '[' || c == ']' || c == ',') c = ' ';
    }
    std::istringstream in(text);
    return {std::istream_iterator<double>(in), {}};
  }

  TemporaryFolder folder_;
  MovingCells take_ = ThreeCubesWithCopiesAndPairs();
  std::string text_;
};

TEST_F(UsdWithCopies, ACopyIsAnInstancerWithItsOwnTime) {
  const std::string copy = Prim("PointInstancer \"copy_000\"");
  EXPECT_THAT(copy, HasSubstr("rel prototypes = [</Take/Cells/Prototypes/cell_00000>, </Take/Cells/Prototypes/cell_00002>]"));
  EXPECT_THAT(copy, HasSubstr("0: \"invisible\",\n            1: \"inherited\",\n            3: \"inherited\","));
  EXPECT_THAT(Sample(copy, "invisibleIds", "3"), ElementsAre(1));
  EXPECT_THAT(Sample(copy, "float3[] scales", "1"), ElementsAre(0.5, 0.5, 0.5, 1, 1, 1));
  // A cube's corner by the sample's own position, orientation and scale.
  for (const auto& [code, s, instance, name] :
       {std::tuple("1", 1, 0, "copy_000_cell_00000"), std::tuple("1", 1, 1, "copy_000_cell_00002"), std::tuple("3", 2, 0, "copy_000_cell_00000")}) {
    const auto i = static_cast<std::size_t>(instance);
    const std::vector<double> x = Sample(copy, "positions", code), q = Sample(copy, "orientations", code), size = Sample(copy, "scales", code);
    ASSERT_EQ(x.size(), 6u);
    ASSERT_EQ(q.size(), 8u);
    std::vector<Vec3> corners;
    const std::size_t cell = i == 0 ? 0 : 2;
    for (const Vec3& v : ShapeOfCell(take_.model.cells, cell).vertices) {
      const geometry::Quat turn(q[4 * i], q[4 * i + 1], q[4 * i + 2], q[4 * i + 3]);
      corners.push_back(turn.normalized() * (size[3 * i] * v) + Vec3(x[3 * i], x[3 * i + 1], x[3 * i + 2]));
    }
    const std::vector<Vec3> expected = CornersByName(take_, static_cast<std::size_t>(s)).at(name);
    for (std::size_t v = 0; v < 8; ++v) EXPECT_LT((corners[v] - expected[v]).norm(), 1e-4) << name;  // orientations have five digits
  }
  EXPECT_THAT(Prim("PointInstancer \"copy_004\""), HasSubstr("1: \"invisible\",\n            3: \"inherited\","));
}

TEST_F(UsdWithCopies, APairIsAMeshWhosePointsMove) {
  const std::string pair = Prim("Mesh \"pair_00000\"");
  EXPECT_THAT(pair, HasSubstr("int[] faceVertexCounts = [3, 3, 3, 3]"));
  for (const auto& [code, s] : {std::pair("1", 1), std::pair("3", 2)}) {
    const std::vector<double> points = Sample(pair, "points", code), t = Sample(pair, "xformOp:translate", code),
                              q = Sample(pair, "xformOp:orient", code), size = Sample(pair, "xformOp:scale", code);
    ASSERT_EQ(points.size(), 12u);
    ASSERT_EQ(q.size(), 4u);
    const std::vector<Vec3> expected = CornersByName(take_, static_cast<std::size_t>(s)).at("pair_00000");
    for (std::size_t v = 0; v < 4; ++v) {
      const Vec3 local = size[0] * Vec3(points[3 * v], points[3 * v + 1], points[3 * v + 2]);
      const Vec3 x = geometry::Quat(q[0], q[1], q[2], q[3]).normalized() * local + Vec3(t[0], t[1], t[2]);
      EXPECT_LT((x - expected[v]).norm(), 1e-4);
    }
  }
  EXPECT_THAT(pair, HasSubstr("0: \"invisible\",\n            1: \"inherited\","));
}

TEST_F(UsdWithCopies, CellsShrinkAndBracesBalance) {
  EXPECT_THAT(Sample(Prim("PointInstancer \"Cells\""), "scales", "1"), ElementsAre(0.75, 0.75, 0.75, 0.5, 0.5, 0.5, 1, 1, 1));
  for (const auto& [open, close] : {std::pair{'{', '}'}, {'[', ']'}, {'(', ')'}}) {
    EXPECT_EQ(std::ranges::count(text_, open), std::ranges::count(text_, close)) << open;
  }
}

}  // namespace
}  // namespace vorocast::interchange
