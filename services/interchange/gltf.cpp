// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/interchange/gltf.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <span>
#include <string>

#include <fmt/format.h>
#include <tiny_gltf.h>

#include "services/geometry/polygon.h"
#include "services/interchange/pieces.h"

namespace vorocast::interchange {
namespace {

using geometry::Rigid3;
using geometry::Vec3;
using geometry::Vec3f;

static_assert(std::endian::native == std::endian::little, "glTF's buffers are little-endian and are written as they lie in memory");

/// The buffer views of the file, in their order. Accessors of one use share a view.
enum View : int { kPositions, kNormals, kIndices, kTimes, kTranslations, kRotations, kScales, kWeights, kViewCount };
enum Material : int { kSkin, kCut, kObject, kTurning };

/// Corners of flat-shaded triangles: each face has corners of its own.
struct FlatMesh {
  std::vector<Vec3f> positions;
  std::vector<Vec3f> displacements;  // to where a corner goes, of a shape that turns into another; else empty
  std::vector<Vec3f> normals;
  std::vector<std::uint32_t> indices;

  void AddFace(std::span<const Vec3> corners) { AddFace(corners, corners, {}); }

  /// Corners that go from one place to another. Faces of a sum of two shapes keep their normals all the way, but vanish at the ends: the normal is
  /// that in between.
  void AddFace(std::span<const Vec3> corners, std::span<const Vec3> between, std::span<const Vec3> to) {
    Vec3 area = Vec3::Zero();
    for (std::size_t i = 1; i + 1 < between.size(); ++i) area += (between[i] - between[0]).cross(between[i + 1] - between[0]);
    if (area.squaredNorm() == 0) return;
    const Vec3f normal = area.normalized().cast<float>();
    const auto first = static_cast<std::uint32_t>(positions.size());
    for (std::size_t i = 0; i < corners.size(); ++i) {
      positions.push_back(corners[i].cast<float>());
      if (!to.empty()) displacements.emplace_back((to[i] - corners[i]).cast<float>());
      normals.push_back(normal);
    }
    for (const auto& triangle : geometry::Triangulate(between)) {
      for (const std::int32_t i : triangle) indices.push_back(first + static_cast<std::uint32_t>(i));
    }
  }
};

/// Keys of one node, one an instant, from the instant `first` on; before it and after its last key a node keeps the first and the last.
struct Keys {
  std::size_t first = 0;
  std::vector<Rigid3> poses;
  std::vector<float> sizes;    // empty: always 1
  std::vector<float> weights;  // of the displacements; empty: the mesh has none
};

class GltfScene {
 public:
  GltfScene(const std::vector<double>& time, bool has_turning) : seconds_(time.begin(), time.end()) {
    model_.asset.version = "2.0";
    model_.asset.generator = "Vorocast";
    AddMaterial("skin", {0.80, 0.62, 0.48, 1}, 0, 0.6);
    AddMaterial("cut", {0.45, 0.12, 0.08, 1}, 0, 0.8);
    AddMaterial("object", {0.5, 0.5, 0.52, 1}, 1, 0.4);
    if (has_turning) AddMaterial("turning", {0.80, 0.62, 0.48, 1}, 0, 0.6);
    model_.animations.emplace_back().name = "take";
    model_.nodes.emplace_back().name = "Vorocast";
    model_.scenes.emplace_back().nodes.push_back(0);
    model_.defaultScene = 0;
    // All instants lie one after another in the buffer; a node with fewer keys has a part of them.
    Accessor(kTimes, std::as_bytes(std::span(seconds_)), seconds_.size(), TINYGLTF_TYPE_SCALAR);
    Bound(0, 0, seconds_.size());
    times_[{0, seconds_.size()}] = 0;
  }

  /// A mesh with one primitive a material that has triangles; −1 where none has. Several nodes may show it.
  int AddMesh(const std::string& name, std::span<const std::pair<const FlatMesh*, Material>> parts) {
    tinygltf::Mesh mesh;
    mesh.name = name;
    for (const auto& [part, material] : parts) {
      if (part->indices.empty()) continue;
      mesh.primitives.push_back(AddPrimitive(*part, material));
      if (!part->displacements.empty()) mesh.weights = {0};
    }
    if (mesh.primitives.empty()) return -1;
    model_.meshes.push_back(std::move(mesh));
    return static_cast<int>(model_.meshes.size()) - 1;
  }

  /// A node under the root.
  tinygltf::Node& AddNode(const std::string& name, int mesh) {
    tinygltf::Node node;
    node.name = name;
    node.mesh = mesh;
    const int index = static_cast<int>(model_.nodes.size());
    model_.nodes.push_back(std::move(node));
    model_.nodes[0].children.push_back(index);
    return model_.nodes.back();
  }

  /// Gives the last node its motion. What never moves has its pose at the node alone.
  void Animate(Keys keys) {
    const Rigid3 first = keys.poses.front();
    tinygltf::Node& moved = model_.nodes.back();
    moved.translation = {first.translation.x(), first.translation.y(), first.translation.z()};
    moved.rotation = {first.rotation.x(), first.rotation.y(), first.rotation.z(), first.rotation.w()};
    bool moves = false;
    bool turns = false;
    std::vector<Vec3f> translations;
    std::vector<Eigen::Vector4f> rotations;  // x y z w, glTF's order
    for (std::size_t i = 0; i < keys.poses.size(); ++i) {
      Rigid3& pose = keys.poses[i];
      // q and −q are one rotation; viewers interpolate the four numbers, so neighbours must not differ in sign.
      if (i > 0 && pose.rotation.dot(keys.poses[i - 1].rotation) < 0) pose.rotation.coeffs() *= -1;
      moves |= pose.translation != first.translation;
      turns |= pose.rotation.coeffs() != first.rotation.coeffs();
      translations.push_back(pose.translation.cast<float>());
      rotations.push_back(pose.rotation.coeffs().cast<float>());
    }
    const int time = TimeOf(keys.first, keys.poses.size());
    if (moves)
      AddChannel("translation", "LINEAR", time,
                 Accessor(kTranslations, std::as_bytes(std::span(translations)), translations.size(), TINYGLTF_TYPE_VEC3));
    if (turns)
      AddChannel("rotation", "LINEAR", time, Accessor(kRotations, std::as_bytes(std::span(rotations)), rotations.size(), TINYGLTF_TYPE_VEC4));
    if (!keys.sizes.empty()) AnimateSize(keys.sizes, time);
    if (!keys.weights.empty())
      AddChannel("weights", "LINEAR", time, Accessor(kWeights, std::as_bytes(std::span(keys.weights)), keys.weights.size(), TINYGLTF_TYPE_SCALAR));
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

  /// The accessor of the times of `count` instants from `first` on.
  int TimeOf(std::size_t first, std::size_t count) {
    const auto [found, is_new] = times_.emplace(std::pair(first, count), static_cast<int>(model_.accessors.size()));
    if (is_new) {
      tinygltf::Accessor part = model_.accessors[0];
      part.byteOffset = first * sizeof(float);
      part.count = count;
      model_.accessors.push_back(part);
      Bound(found->second, first, count);
    }
    return found->second;
  }
  void Bound(int times, std::size_t first, std::size_t count) {
    model_.accessors[static_cast<std::size_t>(times)].minValues = {seconds_[first]};
    model_.accessors[static_cast<std::size_t>(times)].maxValues = {seconds_[first + count - 1]};
  }

  /// A node of size 0 is not drawn; what only comes and goes does so at once.
  void AnimateSize(const std::vector<float>& sizes, int time) {
    std::vector<Vec3f> scales;
    for (const float size : sizes) scales.push_back(Vec3f::Constant(size));
    const bool grows = std::ranges::any_of(sizes, [](float size) { return size != 0 && size != 1; });
    model_.nodes.back().scale.assign(3, sizes.front());
    AddChannel("scale", grows ? "LINEAR" : "STEP", time, Accessor(kScales, std::as_bytes(std::span(scales)), sizes.size(), TINYGLTF_TYPE_VEC3));
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

  /// With the bounds that the format wants of positions.
  int Positions(const std::vector<Vec3f>& positions) {
    Eigen::AlignedBox3f box;
    for (const Vec3f& position : positions) box.extend(position);
    const int index = Accessor(kPositions, std::as_bytes(std::span(positions)), positions.size(), TINYGLTF_TYPE_VEC3);
    tinygltf::Accessor& bounds = model_.accessors[static_cast<std::size_t>(index)];
    bounds.minValues = {box.min().x(), box.min().y(), box.min().z()};
    bounds.maxValues = {box.max().x(), box.max().y(), box.max().z()};
    return index;
  }

  tinygltf::Primitive AddPrimitive(const FlatMesh& mesh, Material material) {
    tinygltf::Primitive primitive;
    primitive.mode = TINYGLTF_MODE_TRIANGLES;
    primitive.material = material;
    primitive.attributes["POSITION"] = Positions(mesh.positions);
    if (!mesh.displacements.empty()) primitive.targets.push_back({{"POSITION", Positions(mesh.displacements)}});
    primitive.attributes["NORMAL"] = Accessor(kNormals, std::as_bytes(std::span(mesh.normals)), mesh.normals.size(), TINYGLTF_TYPE_VEC3);
    primitive.indices =
        Accessor(kIndices, std::as_bytes(std::span(mesh.indices)), mesh.indices.size(), TINYGLTF_TYPE_SCALAR, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT);
    return primitive;
  }

  /// Of the last node.
  void AddChannel(const std::string& path, const std::string& interpolation, int time, int output) {
    tinygltf::Animation& animation = model_.animations[0];
    tinygltf::AnimationSampler& sampler = animation.samplers.emplace_back();
    sampler.input = time;
    sampler.output = output;
    sampler.interpolation = interpolation;
    tinygltf::AnimationChannel& channel = animation.channels.emplace_back();
    channel.sampler = static_cast<int>(animation.samplers.size()) - 1;
    channel.target_node = static_cast<int>(model_.nodes.size()) - 1;
    channel.target_path = path;
  }

  tinygltf::Model model_;
  std::array<std::vector<unsigned char>, kViewCount> views_;
  std::vector<float> seconds_;
  std::map<std::pair<std::size_t, std::size_t>, int> times_;  // first instant and count, to their accessor
};

int AddShape(const CellShape& shape, const std::string& name, GltfScene& scene) {
  FlatMesh skin, cut;
  std::vector<Vec3> corners, between, to;
  for (const CellShape::Face& face : shape.faces) {
    corners.clear();
    between.clear();
    to.clear();
    for (const std::int32_t i : face.loop) {
      const auto v = static_cast<std::size_t>(i);
      corners.push_back(shape.vertices[v]);
      if (shape.vertices_to.empty()) continue;
      between.emplace_back(0.5 * (shape.vertices[v] + shape.vertices_to[v]));
      to.push_back(shape.vertices_to[v]);
    }
    if (to.empty()) {
      (face.skin ? skin : cut).AddFace(corners);
    } else {
      skin.AddFace(corners, between, to);
    }
  }
  const std::pair<const FlatMesh*, Material> parts[] = {{&skin, shape.vertices_to.empty() ? kSkin : kTurning}, {&cut, kCut}};
  return scene.AddMesh(name, parts);
}

tinygltf::Value ExtrasOf(const MovingCells& take, const Piece& piece) {
  tinygltf::Value::Object extras;
  if (piece.cell >= 0) {
    const auto cell = static_cast<std::size_t>(piece.cell);
    extras["cell"] = tinygltf::Value(piece.cell);
    extras["patch"] = tinygltf::Value(take.model.patch[cell]);
    extras["component"] = tinygltf::Value(take.model.cells.component[cell]);
  }
  if (piece.copy >= 0) extras["copy"] = tinygltf::Value(piece.copy);
  if (piece.pair >= 0) {
    extras["pair"] = tinygltf::Value(piece.pair);
    extras["target"] = tinygltf::Value(take.morph.target[static_cast<std::size_t>(piece.pair)]);
  }
  return tinygltf::Value(extras);
}

/// From the instant before it comes, where its size is 0, to the one after it has gone.
Keys KeysOf(const MovingCells& take, const Piece& piece) {
  Keys keys{.first = piece.first == 0 ? 0 : piece.first - 1};
  for (std::size_t s = keys.first; s <= std::min(piece.last + 1, take.instant_count() - 1); ++s) {
    const Placement placement = PlacementOf(take, piece, s);
    keys.poses.push_back(placement.world_from_shape);
    keys.sizes.push_back(placement.size);
    if (piece.pair >= 0) keys.weights.push_back(placement.blend);
  }
  if (std::ranges::all_of(keys.sizes, [](float size) { return size == 1; })) keys.sizes.clear();
  return keys;
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
  scene.AddNode(shown.name, scene.AddMesh(shown.name, parts));
  Keys keys;
  for (std::size_t s = 0; s < take.instant_count(); ++s) keys.poses.push_back(take.object_pose[s * take.objects.size() + object]);
  scene.Animate(std::move(keys));
}

}  // namespace

absl::Status WriteGltf(const MovingCells& take, const std::filesystem::path& path, const base::Progress& progress) {
  const std::vector<Piece> pieces = PiecesOf(take);
  const std::vector<CellShape> shapes = ShapesOf(take);
  GltfScene scene(take.time, !pieces.empty() && pieces.back().pair >= 0);
  std::vector<int> mesh_of(shapes.size(), -1);
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const Piece& piece = pieces[i];
    // Cells come first, so copies find their cell's mesh.
    if (piece.copy < 0) mesh_of[piece.shape] = AddShape(shapes[piece.shape], piece.Name(), scene);
    scene.AddNode(piece.Name(), mesh_of[piece.shape]).extras = ExtrasOf(take, piece);
    scene.Animate(KeysOf(take, piece));
    if (i % 256 == 0) base::Report(progress, static_cast<double>(i) / static_cast<double>(pieces.size()));
  }
  for (std::size_t object = 0; object < take.objects.size(); ++object) AddObject(take, object, scene);
  return scene.Write(path);
}

}  // namespace vorocast::interchange
