// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/interchange/gltf.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <fstream>
#include <limits>
#include <span>
#include <string>

#include <fmt/format.h>
#include <tiny_gltf.h>

#include "services/geometry/polygon.h"

namespace vorocast::interchange {
namespace {

using geometry::CellState;
using geometry::Rigid3;
using geometry::Vec3;
using geometry::Vec3f;

static_assert(std::endian::native == std::endian::little, "glTF's buffers are little-endian and are written as they lie in memory");

/// The buffer views of the file, in their order. Accessors of one use share a view.
enum View : int { kPositions, kNormals, kIndices, kTimes, kTranslations, kRotations, kScales, kViewCount };
enum Material : int { kSkin, kCut, kObject };

/// Corners of flat-shaded triangles: each face has corners of its own.
struct FlatMesh {
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;
  std::vector<std::uint32_t> indices;

  void AddFace(std::span<const Vec3> corners) {
    Vec3 area = Vec3::Zero();
    for (std::size_t i = 1; i + 1 < corners.size(); ++i) area += (corners[i] - corners[0]).cross(corners[i + 1] - corners[0]);
    if (area.squaredNorm() == 0) return;
    const Vec3f normal = area.normalized().cast<float>();
    const auto first = static_cast<std::uint32_t>(positions.size());
    for (const Vec3& corner : corners) {
      positions.push_back(corner.cast<float>());
      normals.push_back(normal);
    }
    for (const auto& triangle : geometry::Triangulate(corners)) {
      for (const std::int32_t i : triangle) indices.push_back(first + static_cast<std::uint32_t>(i));
    }
  }
};

class GltfScene {
 public:
  explicit GltfScene(const std::vector<double>& time) {
    model_.asset.version = "2.0";
    model_.asset.generator = "Vorocast";
    AddMaterial("skin", {0.80, 0.62, 0.48, 1}, 0, 0.6);
    AddMaterial("cut", {0.45, 0.12, 0.08, 1}, 0, 0.8);
    AddMaterial("object", {0.5, 0.5, 0.52, 1}, 1, 0.4);
    model_.animations.emplace_back().name = "take";
    model_.nodes.emplace_back().name = "Vorocast";
    model_.scenes.emplace_back().nodes.push_back(0);
    model_.defaultScene = 0;
    std::vector<float> seconds(time.begin(), time.end());
    time_ = Accessor(kTimes, std::as_bytes(std::span(seconds)), seconds.size(), TINYGLTF_TYPE_SCALAR);
    model_.accessors[static_cast<std::size_t>(time_)].minValues = {seconds.front()};
    model_.accessors[static_cast<std::size_t>(time_)].maxValues = {seconds.back()};
  }

  /// A node under the root with one primitive a material that has triangles.
  int AddNode(const std::string& name, std::span<const std::pair<const FlatMesh*, Material>> parts) {
    tinygltf::Mesh mesh;
    mesh.name = name;
    for (const auto& [part, material] : parts) {
      if (!part->indices.empty()) mesh.primitives.push_back(AddPrimitive(*part, material));
    }
    tinygltf::Node node;
    node.name = name;
    if (!mesh.primitives.empty()) {
      node.mesh = static_cast<int>(model_.meshes.size());
      model_.meshes.push_back(std::move(mesh));
    }
    const int index = static_cast<int>(model_.nodes.size());
    model_.nodes.push_back(std::move(node));
    model_.nodes[0].children.push_back(index);
    return index;
  }

  tinygltf::Node& node(int index) { return model_.nodes[static_cast<std::size_t>(index)]; }

  /// One pose an instant. What never moves has its pose at the node alone.
  void Animate(int node_index, std::vector<Rigid3>& poses) {
    const Rigid3 first = poses.front();
    tinygltf::Node& moved = node(node_index);
    moved.translation = {first.translation.x(), first.translation.y(), first.translation.z()};
    moved.rotation = {first.rotation.x(), first.rotation.y(), first.rotation.z(), first.rotation.w()};
    bool moves = false;
    bool turns = false;
    std::vector<Vec3f> translations;
    std::vector<Eigen::Vector4f> rotations;  // x y z w, glTF's order
    for (std::size_t i = 0; i < poses.size(); ++i) {
      // q and −q are one rotation; viewers interpolate the four numbers, so neighbours must not differ in sign.
      if (i > 0 && poses[i].rotation.dot(poses[i - 1].rotation) < 0) poses[i].rotation.coeffs() *= -1;
      moves |= poses[i].translation != first.translation;
      turns |= poses[i].rotation.coeffs() != first.rotation.coeffs();
      translations.push_back(poses[i].translation.cast<float>());
      rotations.push_back(poses[i].rotation.coeffs().cast<float>());
    }
    if (moves)
      AddChannel(node_index, "translation", "LINEAR",
                 Accessor(kTranslations, std::as_bytes(std::span(translations)), poses.size(), TINYGLTF_TYPE_VEC3));
    if (turns)
      AddChannel(node_index, "rotation", "LINEAR", Accessor(kRotations, std::as_bytes(std::span(rotations)), poses.size(), TINYGLTF_TYPE_VEC4));
  }

  /// Sizes, one an instant. A node of size 0 is not drawn; what only comes and goes does so at once.
  void AnimateSize(int node_index, const std::vector<float>& sizes) {
    std::vector<Vec3f> scales;
    for (const float size : sizes) scales.push_back(Vec3f::Constant(size));
    const bool grows = std::ranges::any_of(sizes, [](float size) { return size != 0 && size != 1; });
    node(node_index).scale.assign(3, sizes.front());
    AddChannel(node_index, "scale", grows ? "LINEAR" : "STEP", Accessor(kScales, std::as_bytes(std::span(scales)), sizes.size(), TINYGLTF_TYPE_VEC3));
  }

  absl::Status Write(const std::filesystem::path& path) {
    std::size_t total = 0;
    for (const auto& bytes : views_) total += bytes.size();
    if (total > std::numeric_limits<std::uint32_t>::max() - kHeadRoom) {
      return absl::ResourceExhaustedError(
          fmt::format("{}: binary glTF holds at most 4 GiB and this take needs {:.1f}; export fewer instants (--every)", path.string(),
                      static_cast<double>(total) / 1073741824.0));
    }
    tinygltf::Buffer& buffer = model_.buffers.emplace_back();
    buffer.data.reserve(total);
    // Views without content cannot be written, so those that follow move up.
    std::array<int, kViewCount> place{};
    for (int view = 0; view < kViewCount; ++view) {
      std::vector<unsigned char>& bytes = views_[static_cast<std::size_t>(view)];
      place[static_cast<std::size_t>(view)] = static_cast<int>(model_.bufferViews.size());
      if (bytes.empty()) continue;
      tinygltf::BufferView& added = model_.bufferViews.emplace_back();
      added.buffer = 0;
      added.byteOffset = buffer.data.size();
      added.byteLength = bytes.size();
      if (view == kPositions || view == kNormals) added.byteStride = sizeof(Vec3f);
      if (view <= kIndices) added.target = view == kIndices ? TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER : TINYGLTF_TARGET_ARRAY_BUFFER;
      buffer.data.insert(buffer.data.end(), bytes.begin(), bytes.end());
      bytes = {};
    }
    for (tinygltf::Accessor& accessor : model_.accessors) accessor.bufferView = place[static_cast<std::size_t>(accessor.bufferView)];
    if (model_.animations[0].channels.empty()) model_.animations.clear();
    std::ofstream file(path, std::ios::binary | std::ios::trunc);
    const bool written = file.good() && tinygltf::TinyGLTF().WriteGltfSceneToStream(&model_, file, /*prettyPrint=*/false, /*writeBinary=*/true);
    file.close();
    if (!written || !file) return absl::UnavailableError(fmt::format("{}: cannot be written: {}", path.string(), std::strerror(errno)));
    return absl::OkStatus();
  }

 private:
  /// For the JSON beside the buffer.
  static constexpr std::size_t kHeadRoom = std::size_t{1} << 28;

  void AddMaterial(const std::string& name, const std::vector<double>& colour, double metallic, double roughness) {
    tinygltf::Material& material = model_.materials.emplace_back();
    material.name = name;
    material.pbrMetallicRoughness.baseColorFactor = colour;
    material.pbrMetallicRoughness.metallicFactor = metallic;
    material.pbrMetallicRoughness.roughnessFactor = roughness;
  }

  int Accessor(View view, std::span<const std::byte> bytes, std::size_t count, int type, int component = TINYGLTF_COMPONENT_TYPE_FLOAT) {
    std::vector<unsigned char>& buffer = views_[view];
    tinygltf::Accessor& accessor = model_.accessors.emplace_back();
    accessor.bufferView = view;
    accessor.byteOffset = buffer.size();
    accessor.count = count;
    accessor.type = type;
    accessor.componentType = component;
    const auto* first = reinterpret_cast<const unsigned char*>(bytes.data());
    buffer.insert(buffer.end(), first, first + bytes.size());
    return static_cast<int>(model_.accessors.size()) - 1;
  }

  tinygltf::Primitive AddPrimitive(const FlatMesh& mesh, Material material) {
    Eigen::AlignedBox3f box;
    for (const Vec3f& position : mesh.positions) box.extend(position);
    tinygltf::Primitive primitive;
    primitive.mode = TINYGLTF_MODE_TRIANGLES;
    primitive.material = material;
    const int positions = Accessor(kPositions, std::as_bytes(std::span(mesh.positions)), mesh.positions.size(), TINYGLTF_TYPE_VEC3);
    tinygltf::Accessor& bounds = model_.accessors[static_cast<std::size_t>(positions)];
    bounds.minValues = {box.min().x(), box.min().y(), box.min().z()};
    bounds.maxValues = {box.max().x(), box.max().y(), box.max().z()};
    primitive.attributes["POSITION"] = positions;
    primitive.attributes["NORMAL"] = Accessor(kNormals, std::as_bytes(std::span(mesh.normals)), mesh.normals.size(), TINYGLTF_TYPE_VEC3);
    primitive.indices =
        Accessor(kIndices, std::as_bytes(std::span(mesh.indices)), mesh.indices.size(), TINYGLTF_TYPE_SCALAR, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT);
    return primitive;
  }

  void AddChannel(int node_index, const std::string& path, const std::string& interpolation, int output) {
    tinygltf::Animation& animation = model_.animations[0];
    tinygltf::AnimationSampler& sampler = animation.samplers.emplace_back();
    sampler.input = time_;
    sampler.output = output;
    sampler.interpolation = interpolation;
    tinygltf::AnimationChannel& channel = animation.channels.emplace_back();
    channel.sampler = static_cast<int>(animation.samplers.size()) - 1;
    channel.target_node = node_index;
    channel.target_path = path;
  }

  tinygltf::Model model_;
  std::array<std::vector<unsigned char>, kViewCount> views_;
  int time_ = 0;
};

void AddCell(const MovingCells& take, std::size_t cell, GltfScene& scene) {
  const CellShape shape = ShapeOfCell(take.model.cells, cell);
  FlatMesh skin, cut;
  std::vector<Vec3> corners;
  for (const CellShape::Face& face : shape.faces) {
    corners.clear();
    for (const std::int32_t v : face.loop) corners.push_back(shape.vertices[static_cast<std::size_t>(v)]);
    (face.skin ? skin : cut).AddFace(corners);
  }
  const std::pair<const FlatMesh*, Material> parts[] = {{&skin, kSkin}, {&cut, kCut}};
  const int node = scene.AddNode(fmt::format("cell_{:05d}", cell), parts);
  tinygltf::Value::Object extras;
  extras["cell"] = tinygltf::Value(static_cast<int>(cell));
  extras["patch"] = tinygltf::Value(take.model.patch[cell]);
  extras["component"] = tinygltf::Value(take.model.cells.component[cell]);
  scene.node(node).extras = tinygltf::Value(extras);

  std::vector<Rigid3> poses;
  std::vector<float> sizes;
  for (std::size_t s = 0; s < take.instant_count(); ++s) {
    poses.push_back(WorldFromShape(take, s, cell));
    sizes.push_back(take.Size(s, cell));
  }
  scene.Animate(node, poses);
  if (std::ranges::any_of(sizes, [](float size) { return size != 1; })) scene.AnimateSize(node, sizes);
}

void AddObject(const MovingCells& take, std::size_t object, GltfScene& scene) {
  const geometry::SceneObject& shown = take.objects[object];
  FlatMesh mesh;
  for (const auto& t : shown.mesh.triangles) {
    const Vec3 corners[] = {shown.mesh.vertices[static_cast<std::size_t>(t[0])], shown.mesh.vertices[static_cast<std::size_t>(t[1])],
                            shown.mesh.vertices[static_cast<std::size_t>(t[2])]};
    mesh.AddFace(corners);
  }
  const std::pair<const FlatMesh*, Material> parts[] = {{&mesh, kObject}};
  const int node = scene.AddNode(shown.name, parts);
  std::vector<Rigid3> poses;
  for (std::size_t s = 0; s < take.instant_count(); ++s) poses.push_back(take.object_pose[s * take.objects.size() + object]);
  scene.Animate(node, poses);
}

}  // namespace

absl::Status WriteGltf(const MovingCells& take, const std::filesystem::path& path, const base::Progress& progress) {
  GltfScene scene(take.time);
  for (std::size_t c = 0; c < take.cell_count(); ++c) {
    AddCell(take, c, scene);
    if (c % 256 == 0) base::Report(progress, static_cast<double>(c) / static_cast<double>(take.cell_count()));
  }
  for (std::size_t object = 0; object < take.objects.size(); ++object) AddObject(take, object, scene);
  return scene.Write(path);
}

}  // namespace vorocast::interchange
