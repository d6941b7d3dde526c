// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/depth_cameras.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

namespace vorocast::synth {
namespace {

using geometry::Box3;
using geometry::Vec3;

constexpr double kReserve = 1.35;         // points seen for each point wanted
constexpr double kBlindCosine = 0.06;     // depth cameras get nothing back below this …
constexpr double kReliableCosine = 0.30;  // … and everything above this
constexpr double kEdge_m = 0.04;          // a jump in depth between neighbouring pixels
constexpr double kFlight_m = 0.05;        // how far flying pixels hang behind an edge, in the mean
constexpr double kColourNoise = 5;
constexpr double kSeenCosine = 0.17;

/// Any unit vector across `n`.
Vec3 Across(const Vec3& n) { return n.unitOrthogonal(); }

/// Turns `n` by a random angle of standard deviation `sigma_rad` about two axes.
Vec3 Tilted(const Vec3& n, double sigma_rad, base::Random& random) {
  const Vec3 a = Across(n);
  const Vec3 b = n.cross(a);
  const double u = sigma_rad * random.Gaussian();
  const double v = sigma_rad * random.Gaussian();
  return (n + u * a + v * b).normalized();
}

RTCRay RayFrom(const Vec3& from, const Vec3& direction, double near, double far) {
  const Eigen::Vector3f o = from.cast<float>(), d = direction.cast<float>();
  return {.org_x = o.x(),
          .org_y = o.y(),
          .org_z = o.z(),
          .tnear = static_cast<float>(near),
          .dir_x = d.x(),
          .dir_y = d.y(),
          .dir_z = d.z(),
          .time = 0,
          .tfar = static_cast<float>(far),
          .mask = ~0U,
          .id = 0,
          .flags = 0};
}

}  // namespace

/// Embree's view of the surface in one frame. One thread and one instruction set, so that a seed means the same everywhere.
struct DepthScanner::Scene {
  RTCDevice device = rtcNewDevice("threads=1,isa=avx2");
  RTCScene scene = nullptr;
  RTCGeometry geometry = nullptr;
  float* positions = nullptr;

  explicit Scene(const geometry::TriangleMesh& surface) {
    scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_LOW);
    geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    positions = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), surface.vertices.size()));
    auto* indices = static_cast<std::uint32_t*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t), surface.triangles.size()));
    for (const auto& t : surface.triangles) {
      for (std::int32_t v : t) *indices++ = static_cast<std::uint32_t>(v);
    }
    rtcAttachGeometry(scene, geometry);
  }
  ~Scene() {
    rtcReleaseGeometry(geometry);
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  void Move(std::span<const Vec3> vertices) {
    float* to = positions;
    for (const Vec3& x : vertices) {
      for (int axis = 0; axis < 3; ++axis) *to++ = static_cast<float>(x[axis]);
    }
    rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
    rtcCommitGeometry(geometry);
    rtcCommitScene(scene);
  }
};

/// A pixel that came back.
struct DepthScanner::Hit {
  Vec3 position, normal;
  Vec3 ray;  // unit, from the camera
  double cosine = 0;
  geometry::Rgb8 colour{};
  bool at_edge = false;  // a neighbouring pixel sees nothing, or something much farther
};

std::vector<DepthCamera> RingOfCameras(const Box3& subject, std::int32_t count) {
  const Vec3 middle = subject.center();
  const double size = subject.diagonal().norm();
  std::vector<DepthCamera> cameras;
  for (std::int32_t i = 0; i < count; ++i) {
    const double around = 2 * std::numbers::pi * i / count;
    const double height = (i % 2 == 0 ? -0.10 : 0.55) * size;
    DepthCamera camera;
    camera.position = middle + Vec3(1.4 * size * std::sin(around), height, 1.4 * size * std::cos(around));
    camera.forward = (middle - camera.position).normalized();
    camera.right = camera.forward.cross(Vec3::UnitY()).normalized();
    camera.up = camera.right.cross(camera.forward);
    cameras.push_back(camera);
  }
  return cameras;
}

DepthScanner::DepthScanner(const geometry::TriangleMesh& surface, const Box3& subject, const ScanOptions& options)
    : surface_(surface), options_(options), cameras_(RingOfCameras(subject, options.cameras)), scene_(std::make_unique<Scene>(surface)) {}

DepthScanner::~DepthScanner() = default;

std::vector<DepthScanner::Hit> DepthScanner::CastRays(std::span<const Vec3> vertices, double pixel, base::Random& random) const {
  const geometry::TriangleMesh moved{{vertices.begin(), vertices.end()}, surface_.triangles, {}};
  const std::vector<Vec3> normals = geometry::VertexNormals(moved);
  std::vector<Hit> hits;
  for (const DepthCamera& camera : cameras_) {
    // The part of the image that the surface covers.
    Eigen::AlignedBox2d image;
    for (const Vec3& x : vertices) {
      const Vec3 seen = x - camera.position;
      image.extend(Eigen::Vector2d(seen.dot(camera.right), seen.dot(camera.up)) / seen.dot(camera.forward));
    }
    const auto first_column = static_cast<std::int64_t>(std::floor(image.min().x() / pixel));
    const auto first_row = static_cast<std::int64_t>(std::floor(image.min().y() / pixel));
    const std::int64_t columns = static_cast<std::int64_t>(std::ceil(image.max().x() / pixel)) - first_column;
    const std::int64_t rows = static_cast<std::int64_t>(std::ceil(image.max().y() / pixel)) - first_row;
    constexpr double kNothing = std::numeric_limits<double>::infinity();
    std::vector<double> depths(static_cast<std::size_t>(columns * rows), kNothing);
    std::vector<std::int64_t> hit_of_pixel(depths.size(), -1);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    for (std::int64_t row = 0; row < rows; ++row) {
      for (std::int64_t column = 0; column < columns; ++column) {
        // Where in the pixel the ray goes through differs from frame to frame, so that no point of one frame is a point of another.
        const double x = pixel * (static_cast<double>(first_column + column) + random.Uniform());
        const double y = pixel * (static_cast<double>(first_row + row) + random.Uniform());
        const Vec3 ray = (camera.forward + x * camera.right + y * camera.up).normalized();
        RTCRayHit query{};
        query.ray = RayFrom(camera.position, ray, 0, kNothing);
        query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(scene_->scene, &context, &query);
        if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) continue;
        // Embree says which triangle; where on it is computed again in double precision.
        const auto& t = surface_.triangles[query.hit.primID];
        const auto a = static_cast<std::size_t>(t[0]), b = static_cast<std::size_t>(t[1]), c = static_cast<std::size_t>(t[2]);
        const Vec3 area = (vertices[b] - vertices[a]).cross(vertices[c] - vertices[a]);
        const double facing = -ray.dot(area) / area.norm();
        if (!(facing > kBlindCosine)) continue;
        const double depth = (vertices[a] - camera.position).dot(area) / ray.dot(area);
        const auto at = static_cast<std::size_t>(row * columns + column);
        depths[at] = depth;
        if (random.Uniform() > (facing - kBlindCosine) / (kReliableCosine - kBlindCosine)) continue;
        const double u = static_cast<double>(query.hit.u), v = static_cast<double>(query.hit.v);
        Hit hit{.position = camera.position + depth * ray, .ray = ray, .cosine = facing};
        hit.normal = ((1 - u - v) * normals[a] + u * normals[b] + v * normals[c]).normalized();
        if (!surface_.colours.empty()) {
          for (std::size_t channel = 0; channel < 3; ++channel) {
            const double colour = (1 - u - v) * surface_.colours[a][channel] + u * surface_.colours[b][channel] + v * surface_.colours[c][channel];
            hit.colour[channel] = static_cast<std::uint8_t>(std::clamp(colour + kColourNoise * random.Gaussian(), 0.0, 255.0));
          }
        }
        hit_of_pixel[at] = static_cast<std::int64_t>(hits.size());
        hits.push_back(hit);
      }
    }
    for (std::int64_t row = 0; row < rows; ++row) {
      for (std::int64_t column = 0; column < columns; ++column) {
        const auto at = static_cast<std::size_t>(row * columns + column);
        if (hit_of_pixel[at] < 0) continue;
        const bool inner = row > 0 && column > 0 && row + 1 < rows && column + 1 < columns;
        const auto width = static_cast<std::size_t>(columns);
        const double farthest =
            inner ? std::max(std::max(depths[at - 1], depths[at + 1]), std::max(depths[at - width], depths[at + width])) : kNothing;
        hits[static_cast<std::size_t>(hit_of_pixel[at])].at_edge = farthest > depths[at] + kEdge_m;
      }
    }
  }
  return hits;
}

void DepthScanner::Calibrate(std::span<const Vec3> vertices) {
  // The number of hits goes with the inverse square of the pixel's size: a coarse trial tells.
  scene_->Move(vertices);
  constexpr double kTrialPixel = 0.006;
  base::Random random(options_.seed);
  const double hits = static_cast<double>(CastRays(vertices, kTrialPixel, random).size());
  pixel_ = kTrialPixel * std::sqrt(std::max(hits, 1.0) / (kReserve * static_cast<double>(options_.points)));
}

geometry::OrientedPoints DepthScanner::Scan(std::span<const Vec3> vertices, std::int32_t frame) {
  scene_->Move(vertices);
  base::Random random(base::Random(options_.seed ^ (static_cast<std::uint64_t>(frame) + 1) * 0xd1342543de82ef95ULL).Bits());
  std::vector<Hit> hits = CastRays(vertices, pixel_, random);
  for (std::size_t i = hits.size(); i > 1; --i) std::swap(hits[i - 1], hits[random.Below(i)]);
  if (hits.size() > static_cast<std::size_t>(options_.points)) hits.resize(static_cast<std::size_t>(options_.points));

  const auto edges = static_cast<double>(std::ranges::count_if(hits, &Hit::at_edge));
  const double flying = edges > 0 ? options_.flying_fraction * static_cast<double>(hits.size()) / edges : 0;  // chance of a pixel at an edge
  const double tilt_rad = options_.normal_noise_degrees * std::numbers::pi / 180;
  geometry::OrientedPoints points;
  for (const Hit& hit : hits) {
    const double spread = 1 + 0.5 * (1 / std::max(hit.cosine, 0.2) - 1);
    double error = options_.noise_m * spread * random.Gaussian();
    if (hit.at_edge && random.Uniform() < flying) error -= kFlight_m * std::log(1 - random.Uniform());
    points.positions.push_back(hit.position + error * hit.ray);
    points.normals.push_back(Tilted(hit.normal, tilt_rad, random));
    if (!surface_.colours.empty()) points.colours.push_back(hit.colour);
  }
  return points;
}

std::vector<char> DepthScanner::Seen(std::span<const Vec3> vertices) {
  scene_->Move(vertices);
  const geometry::TriangleMesh moved{{vertices.begin(), vertices.end()}, surface_.triangles, {}};
  const std::vector<Vec3> normals = geometry::VertexNormals(moved);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  std::vector<char> seen(vertices.size(), 0);
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    for (const DepthCamera& camera : cameras_) {
      const Vec3 to_vertex = vertices[v] - camera.position;
      const double distance = to_vertex.norm();
      if (-to_vertex.dot(normals[v]) < kSeenCosine * distance) continue;
      RTCRay ray = RayFrom(camera.position, to_vertex / distance, 0, distance - 0.003);
      rtcOccluded1(scene_->scene, &context, &ray);
      if (ray.tfar < 0) continue;
      seen[v] = 1;
      break;
    }
  }
  return seen;
}

}  // namespace vorocast::synth
