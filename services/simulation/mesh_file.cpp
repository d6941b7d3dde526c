// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/mesh_file.h"

#include <fmt/format.h>
#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "services/capture/frame_reader.h"

namespace vorocast::simulation {
namespace {

using geometry::TriangleMesh;
using geometry::Vec3;
using nlohmann::json;
using Transform = Eigen::Affine3d;

constexpr std::size_t kMost = 20000;                  // triangles, and corners
constexpr std::uintmax_t kLargestFile = 64ULL << 20;  // bytes
constexpr int kDeepest = 64;                          // nodes within nodes
constexpr int kNodesMost = 100'000;                   // each as often as it is shown: a few lines of text can show one 2^64 times
constexpr double kGrain = 1e-5;                       // corners are rounded to this: an effect is text

absl::Status Wrong(const std::filesystem::path& path, std::string_view what) {
  return absl::InvalidArgumentError(fmt::format("mesh {}: {}", path.string(), what));
}

Transform NodeTransform(const tinygltf::Node& node) {
  Transform transform = Transform::Identity();
  if (node.matrix.size() == 16) {
    transform.matrix() = Eigen::Map<const Eigen::Matrix4d>(node.matrix.data());
    return transform;
  }
  if (node.translation.size() == 3) transform.translate(Vec3(node.translation[0], node.translation[1], node.translation[2]));
  if (node.rotation.size() == 4) transform.rotate(geometry::Quat(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]));
  if (node.scale.size() == 3) transform.scale(Vec3(node.scale[0], node.scale[1], node.scale[2]));
  return transform;
}

/// Reads one accessor after another; every index in the file is checked against what is there.
class GltfScene {
 public:
  explicit GltfScene(const tinygltf::Model& model) : model_(model) {}

  absl::Status AddNode(int index, const Transform& world_from_parent, int depth, TriangleMesh& mesh) {
    if (++nodes_ > kNodesMost) return absl::InvalidArgumentError(fmt::format("it shows more than {} nodes", kNodesMost));
    if (index < 0 || static_cast<std::size_t>(index) >= model_.nodes.size()) return absl::InvalidArgumentError("a node that is not there");
    if (depth > kDeepest) return absl::InvalidArgumentError("its nodes are nested too deeply");
    const tinygltf::Node& node = model_.nodes[static_cast<std::size_t>(index)];
    const Transform world_from_node = world_from_parent * NodeTransform(node);
    if (node.mesh >= 0 && static_cast<std::size_t>(node.mesh) < model_.meshes.size()) {
      for (const tinygltf::Primitive& primitive : model_.meshes[static_cast<std::size_t>(node.mesh)].primitives)
        RETURN_IF_ERROR(AddPrimitive(primitive, world_from_node, mesh));
    }
    for (const int child : node.children) RETURN_IF_ERROR(AddNode(child, world_from_node, depth + 1, mesh));
    return absl::OkStatus();
  }

 private:
  struct Elements {
    const unsigned char* first = nullptr;
    std::size_t stride = 0;
    std::size_t count = 0;
    int component_type = 0;
  };
  absl::StatusOr<Elements> ElementsOf(int index, int type) const {
    const auto missing = absl::InvalidArgumentError("an accessor that is not there, is sparse, or reaches beyond its buffer");
    if (index < 0 || static_cast<std::size_t>(index) >= model_.accessors.size()) return missing;
    const tinygltf::Accessor& accessor = model_.accessors[static_cast<std::size_t>(index)];
    if (accessor.sparse.isSparse || accessor.type != type || accessor.bufferView < 0 ||
        static_cast<std::size_t>(accessor.bufferView) >= model_.bufferViews.size())
      return missing;
    const tinygltf::BufferView& view = model_.bufferViews[static_cast<std::size_t>(accessor.bufferView)];
    if (view.buffer < 0 || static_cast<std::size_t>(view.buffer) >= model_.buffers.size()) return missing;
    const std::vector<unsigned char>& bytes = model_.buffers[static_cast<std::size_t>(view.buffer)].data;
    const int stride = accessor.ByteStride(view);
    const int element = tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(accessor.componentType)) *
                        tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(type));
    if (stride <= 0 || element <= 0 || accessor.count > bytes.size()) return missing;
    const std::size_t start = view.byteOffset + accessor.byteOffset;
    const std::size_t reach = accessor.count == 0 ? 0 : (accessor.count - 1) * static_cast<std::size_t>(stride) + static_cast<std::size_t>(element);
    if (start > bytes.size() || reach > bytes.size() - start) return missing;
    return Elements{bytes.data() + start, static_cast<std::size_t>(stride), accessor.count, accessor.componentType};
  }

  static std::size_t Index(const Elements& elements, std::size_t i) {
    const unsigned char* at = elements.first + i * elements.stride;
    if (elements.component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE) return *at;
    std::uint32_t value = 0;
    std::memcpy(&value, at, elements.component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ? 2 : 4);
    return value;
  }

  absl::Status AddPrimitive(const tinygltf::Primitive& primitive, const Transform& world_from_node, TriangleMesh& mesh) const {
    if (primitive.mode != TINYGLTF_MODE_TRIANGLES && primitive.mode != -1) return absl::OkStatus();  // points and lines are nothing to hit
    const auto position = primitive.attributes.find("POSITION");
    if (position == primitive.attributes.end()) return absl::OkStatus();
    ASSIGN_OR_RETURN(const Elements corners, ElementsOf(position->second, TINYGLTF_TYPE_VEC3));
    if (corners.component_type != TINYGLTF_COMPONENT_TYPE_FLOAT) return absl::InvalidArgumentError("positions that are no floats");
    if (mesh.vertices.size() + corners.count > kMost) return absl::InvalidArgumentError(fmt::format("more than {} corners", kMost));
    const auto base = static_cast<std::int32_t>(mesh.vertices.size());
    for (std::size_t i = 0; i < corners.count; ++i) {
      Eigen::Vector3f x;
      std::memcpy(x.data(), corners.first + i * corners.stride, sizeof(float) * 3);
      mesh.vertices.emplace_back(world_from_node * x.cast<double>());
    }
    if (mesh.triangles.size() > kMost) return absl::InvalidArgumentError(fmt::format("more than {} triangles", kMost));
    std::vector<std::int32_t> loop;
    if (primitive.indices >= 0) {
      ASSIGN_OR_RETURN(const Elements indices, ElementsOf(primitive.indices, TINYGLTF_TYPE_SCALAR));
      if (indices.component_type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE && indices.component_type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT &&
          indices.component_type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT)
        return absl::InvalidArgumentError("triangles whose corners are no whole numbers");
      if (indices.count > 3 * (kMost - mesh.triangles.size())) return absl::InvalidArgumentError(fmt::format("more than {} triangles", kMost));
      for (std::size_t i = 0; i < indices.count; ++i) {
        const std::size_t index = Index(indices, i);
        if (index >= corners.count) return absl::InvalidArgumentError("a triangle with a corner that is not there");
        loop.push_back(base + static_cast<std::int32_t>(index));
      }
    } else {
      for (std::size_t i = 0; i < corners.count; ++i) loop.push_back(base + static_cast<std::int32_t>(i));
    }
    // A node that mirrors turns the triangles inside out.
    const bool mirrored = world_from_node.linear().determinant() < 0;
    for (std::size_t i = 0; i + 2 < loop.size(); i += 3)
      mesh.triangles.push_back({loop[i], loop[i + (mirrored ? 2 : 1)], loop[i + (mirrored ? 1 : 2)]});
    return absl::OkStatus();
  }

  const tinygltf::Model& model_;
  int nodes_ = 0;  // shown so far
};

absl::StatusOr<TriangleMesh> ReadGltf(const std::filesystem::path& path) {
  tinygltf::TinyGLTF loader;
  tinygltf::Model model;
  std::string error;
  std::string warning;
  // Pictures are nothing to collide with; they are not even looked at.
  loader.SetImageLoader([](tinygltf::Image*, int, std::string*, std::string*, int, int, const unsigned char*, int, void*) { return true; }, nullptr);
  const bool binary = path.extension() == ".glb" || path.extension() == ".GLB";
  bool loaded = false;
  try {
    loaded = binary ? loader.LoadBinaryFromFile(&model, &error, &warning, path.string())
                    : loader.LoadASCIIFromFile(&model, &error, &warning, path.string());
  } catch (const std::exception& exception) {
    return Wrong(path, fmt::format("not a glTF file: {}", exception.what()));
  }
  if (!loaded) return Wrong(path, error.empty() ? "not a glTF file" : error);
  GltfScene scene(model);
  TriangleMesh mesh;
  const int shown = model.defaultScene >= 0 ? model.defaultScene : 0;
  if (static_cast<std::size_t>(shown) >= model.scenes.size()) return Wrong(path, "it has no scene");
  for (const int node : model.scenes[static_cast<std::size_t>(shown)].nodes) {
    if (const absl::Status status = scene.AddNode(node, Transform::Identity(), 0, mesh); !status.ok())
      return Wrong(path, std::string(status.message()));
  }
  return mesh;
}

json ToJson(const TriangleMesh& mesh, const char* part) {
  json list = json::array();
  if (std::string_view(part) == "triangles") {
    for (const auto& triangle : mesh.triangles) list.push_back(triangle);
    return list;
  }
  for (const Vec3& v : mesh.vertices) {
    json point = json::array();
    for (const double x : v) point.push_back(std::round(x / kGrain) * kGrain);
    list.push_back(std::move(point));
  }
  return list;
}

}  // namespace

absl::StatusOr<TriangleMesh> ReadMeshFile(const std::filesystem::path& path) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) return absl::NotFoundError(fmt::format("mesh {}: {}", path.string(), error.message()));
  if (size > kLargestFile) return Wrong(path, fmt::format("{} bytes; at most {} are read", size, kLargestFile));
  std::string extension = path.extension().string();
  std::ranges::transform(extension, extension.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  TriangleMesh mesh;
  if (extension == ".gltf" || extension == ".glb") {
    ASSIGN_OR_RETURN(mesh, ReadGltf(path));
  } else if (capture::IsFrameExtension(extension)) {
    ASSIGN_OR_RETURN(capture::RawFrame frame, capture::ReadRawFrame(path));
    mesh = std::move(frame.mesh);
  } else {
    return Wrong(path, "it is none of .obj, .ply, .off, .drc, .gltf, .glb");
  }
  if (mesh.triangles.empty()) return Wrong(path, "it has no triangles");
  if (mesh.triangles.size() > kMost || mesh.vertices.size() > kMost) {
    return Wrong(path, fmt::format("{} triangles and {} corners; an effect carries at most {} of each: simplify it", mesh.triangles.size(),
                                   mesh.vertices.size(), kMost));
  }
  if (!std::ranges::all_of(mesh.vertices, [](const Vec3& v) { return v.allFinite(); })) return Wrong(path, "a corner is not finite");
  return mesh;
}

absl::Status EmbedMeshFiles(json& effect, const std::filesystem::path& folder) {
  if (!effect.is_object() || !effect.contains("objects") || !effect["objects"].is_array()) return absl::OkStatus();
  for (json& object : effect["objects"]) {
    if (!object.is_object() || !object.contains("file") || !object["file"].is_string()) continue;
    const std::string file = object["file"];
    if (file.empty()) continue;
    ASSIGN_OR_RETURN(const TriangleMesh mesh, ReadMeshFile(folder / file));
    object["vertices"] = ToJson(mesh, "vertices");
    object["triangles"] = ToJson(mesh, "triangles");
    object.erase("file");
  }
  return absl::OkStatus();
}

}  // namespace vorocast::simulation
