// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/scene.h"

#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace vorocast::rendering {
namespace {

using geometry::Vec3f;

/// One thread keeps the tree, and so the pictures, the same; AVX2 is what the whole project is compiled for.
constexpr const char* kDeviceOptions = "threads=1,isa=avx2";

/// Secondary rays leave a triangle this far above it, metres: float rounding at a few metres from the origin is below a micrometre.
constexpr float kTriangleClearance = 2e-5F;

struct DeviceRelease {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneRelease {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using DeviceHandle = std::unique_ptr<RTCDeviceTy, DeviceRelease>;
using SceneHandle = std::unique_ptr<RTCSceneTy, SceneRelease>;

absl::Status DeviceStatus(RTCDevice device) {
  const RTCError error = rtcGetDeviceError(device);
  if (error == RTC_ERROR_NONE) return absl::OkStatus();
  if (error == RTC_ERROR_OUT_OF_MEMORY) return absl::ResourceExhaustedError("the ray tracer is out of memory: ask for fewer cells or points");
  return absl::InternalError(fmt::format("the ray tracer (Embree) failed with its error {}", static_cast<int>(error)));
}

/// An Embree buffer of a geometry, filled by value; null when Embree is out of memory, which DeviceStatus tells.
template <typename Element>
Element* NewBuffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format, std::size_t count) {
  return static_cast<Element*>(rtcSetNewGeometryBuffer(geometry, type, 0, format, sizeof(Element), count));
}

void Attach(RTCScene scene, RTCGeometry geometry, unsigned int id) {
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(scene, geometry, id);
}

void AttachDiscs(RTCDevice device, RTCScene scene, const std::vector<Disc>& discs, unsigned int id) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_ORIENTED_DISC_POINT);
  auto* centres = NewBuffer<std::array<float, 4>>(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT4, discs.size());
  auto* normals = NewBuffer<std::array<float, 3>>(geometry, RTC_BUFFER_TYPE_NORMAL, RTC_FORMAT_FLOAT3, discs.size());
  for (std::size_t i = 0; centres != nullptr && normals != nullptr && i < discs.size(); ++i) {
    const Disc& disc = discs[i];
    centres[i] = {disc.centre.x(), disc.centre.y(), disc.centre.z(), disc.radius};
    normals[i] = {disc.normal.x(), disc.normal.y(), disc.normal.z()};
  }
  Attach(scene, geometry, id);
  rtcReleaseGeometry(geometry);
}

void AttachTriangles(RTCDevice device, RTCScene scene, const Triangles& mesh, unsigned int id) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  const bool moves = !mesh.corners_at_close.empty();
  if (moves) rtcSetGeometryTimeStepCount(geometry, 2);
  for (const unsigned int step : {0U, 1U}) {
    if (step == 1 && !moves) break;
    const std::vector<Vec3f>& from = step == 0 ? mesh.corners : mesh.corners_at_close;
    auto* corners = static_cast<std::array<float, 3>*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, step, RTC_FORMAT_FLOAT3, sizeof(std::array<float, 3>), from.size()));
    for (std::size_t i = 0; corners != nullptr && i < from.size(); ++i) corners[i] = {from[i].x(), from[i].y(), from[i].z()};
  }
  auto* indices = NewBuffer<std::array<std::uint32_t, 3>>(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, mesh.colours.size());
  for (std::uint32_t i = 0; indices != nullptr && i < mesh.colours.size(); ++i) indices[i] = {3 * i, 3 * i + 1, 3 * i + 2};
  Attach(scene, geometry, id);
  rtcReleaseGeometry(geometry);
}

RTCRay ToEmbree(const Ray& ray) {
  RTCRay result{};
  result.org_x = ray.origin.x(), result.org_y = ray.origin.y(), result.org_z = ray.origin.z();
  result.dir_x = ray.direction.x(), result.dir_y = ray.direction.y(), result.dir_z = ray.direction.z();
  result.tnear = 0;
  result.tfar = ray.reach;
  result.time = ray.time;
  result.mask = ~0U;
  return result;
}

}  // namespace

struct Scene::Tree {
  DeviceHandle device;
  SceneHandle scene;
  Vec3f low = Vec3f::Constant(std::numeric_limits<float>::infinity());  // bounds of everything
  Vec3f high = Vec3f::Constant(-std::numeric_limits<float>::infinity());
  // What a hit looks up: geometry 0 are the discs, geometry 1 + i is mesh i.
  std::vector<Disc> discs;
  std::vector<std::vector<Vec3f>> mesh_colours;
  std::vector<bool> mesh_metal;

  /// Most rays of a picture go past everything; this costs a tenth of asking Embree.
  bool Misses(const Ray& ray) const {
    const Vec3f inverse = ray.direction.cwiseInverse();
    const Vec3f a = (low - ray.origin).cwiseProduct(inverse);
    const Vec3f b = (high - ray.origin).cwiseProduct(inverse);
    const float enter = std::max(a.cwiseMin(b).maxCoeff(), 0.0F);
    const float leave = std::min(a.cwiseMax(b).minCoeff(), ray.reach);
    return enter > leave;
  }
};

Scene::Scene(std::unique_ptr<Tree> tree) : tree_(std::move(tree)) {}
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;
Scene::~Scene() = default;

absl::StatusOr<Scene> Scene::Build(const std::vector<Disc>& discs, const std::vector<Triangles>& meshes) {
  auto tree = std::make_unique<Tree>();
  tree->device.reset(rtcNewDevice(kDeviceOptions));
  if (tree->device == nullptr) return absl::InternalError("the ray tracer (Embree) cannot start; it needs a processor with AVX2");
  tree->scene.reset(rtcNewScene(tree->device.get()));
  rtcSetSceneBuildQuality(tree->scene.get(), RTC_BUILD_QUALITY_MEDIUM);
  if (!discs.empty()) AttachDiscs(tree->device.get(), tree->scene.get(), discs, 0);
  for (const Disc& disc : discs) {
    tree->low = tree->low.cwiseMin(disc.centre - Vec3f::Constant(disc.radius));
    tree->high = tree->high.cwiseMax(disc.centre + Vec3f::Constant(disc.radius));
  }
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    if (!meshes[i].colours.empty()) AttachTriangles(tree->device.get(), tree->scene.get(), meshes[i], static_cast<unsigned int>(i + 1));
    tree->mesh_colours.push_back(meshes[i].colours);
    tree->mesh_metal.push_back(meshes[i].metal);
    for (const std::vector<Vec3f>* corners : {&meshes[i].corners, &meshes[i].corners_at_close}) {
      for (const Vec3f& corner : *corners) {
        tree->low = tree->low.cwiseMin(corner);
        tree->high = tree->high.cwiseMax(corner);
      }
    }
  }
  tree->discs = discs;
  rtcCommitScene(tree->scene.get());
  RETURN_IF_ERROR(DeviceStatus(tree->device.get()));
  return Scene(std::move(tree));
}

const Vec3f& Scene::low() const { return tree_->low; }
const Vec3f& Scene::high() const { return tree_->high; }

Hit Scene::HitOf(std::uint32_t geometry, std::uint32_t primitive, float distance, const Vec3f& normal) const {
  Hit hit;
  hit.distance = distance;
  if (geometry == 0) {
    const Disc& disc = tree_->discs[primitive];
    hit.normal = disc.normal;
    hit.colour = disc.colour;
    hit.clearance = 1.5F * disc.radius;
    return hit;
  }
  hit.normal = normal.normalized();
  hit.mesh = geometry - 1;
  hit.triangle = primitive;
  hit.colour = tree_->mesh_colours[hit.mesh][hit.triangle];
  hit.metal = tree_->mesh_metal[hit.mesh];
  hit.clearance = kTriangleClearance;
  return hit;
}

std::optional<Hit> Scene::Intersect(const Ray& ray) const {
  if (tree_->Misses(ray)) return std::nullopt;
  RTCRayHit query{};
  query.ray = ToEmbree(ray);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect1(tree_->scene.get(), &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  return HitOf(query.hit.geomID, query.hit.primID, query.ray.tfar, {query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z});
}

void Scene::Intersect(std::span<const Ray> rays, std::span<std::optional<Hit>> hits) const {
  for (std::size_t i = 0; i < rays.size(); ++i) hits[i] = Intersect(rays[i]);
}

void Scene::Occludes(std::span<const Ray> rays, std::span<std::uint8_t> occluded) const {
  for (std::size_t i = 0; i < rays.size(); ++i) {
    occluded[i] = 0;
    if (tree_->Misses(rays[i])) continue;
    RTCRay query = ToEmbree(rays[i]);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(tree_->scene.get(), &context, &query);
    occluded[i] = query.tfar < 0 ? 1 : 0;
  }
}

}  // namespace vorocast::rendering
