// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "services/base/status.h"
#include "services/geometry/vector.h"

namespace vorocast::rendering {

/// Metres, y up, linear RGB.
struct Disc {
  geometry::Vec3f centre;
  geometry::Vec3f normal;  // unit
  float radius = 0;
  geometry::Vec3f colour;
};

/// Triangles that share no vertices: three consecutive corners each, counter-clockwise seen from outside.
struct Triangles {
  std::vector<geometry::Vec3f> corners;           // [3t]
  std::vector<geometry::Vec3f> corners_at_close;  // [3t] where they are when the shutter closes, or empty: they stand still
  std::vector<geometry::Vec3f> colours;           // [t]
  bool metal = false;
};

struct Ray {
  geometry::Vec3f origin;
  geometry::Vec3f direction;  // unit
  float reach = 0;            // metres
  float time = 0;             // 0 the shutter opens, 1 it closes
};

struct Hit {
  float distance = 0;
  geometry::Vec3f normal;  // unit, outward as its surface says
  geometry::Vec3f colour;
  std::uint32_t mesh = 0;      // in the order of Build; discs have none
  std::uint32_t triangle = 0;  // of the mesh
  float clearance = 0;         // secondary rays start this far above the surface, so that they miss its own roughness
  bool metal = false;
};

/// What rays meet, in an Embree tree built for one thread and one instruction set: the same answers on every machine.
class Scene {
 public:
  /// INTERNAL when Embree cannot be had or runs out of memory.
  static absl::StatusOr<Scene> Build(const std::vector<Disc>& discs, const std::vector<Triangles>& meshes);
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;
  ~Scene();

  /// Corners of the box around everything at any time; the lower above the upper one when there is nothing.
  const geometry::Vec3f& low() const;
  const geometry::Vec3f& high() const;
  std::optional<Hit> Intersect(const Ray& ray) const;
  /// The same for many rays: `hits[i]` is ray i's.
  void Intersect(std::span<const Ray> rays, std::span<std::optional<Hit>> hits) const;
  /// `occluded[i]` is 1 where anything is within the reach of ray i, else 0.
  void Occludes(std::span<const Ray> rays, std::span<std::uint8_t> occluded) const;

 private:
  struct Tree;
  Hit HitOf(std::uint32_t geometry, std::uint32_t primitive, float distance, const geometry::Vec3f& normal) const;
  explicit Scene(std::unique_ptr<Tree> tree);
  std::unique_ptr<Tree> tree_;
};

}  // namespace vorocast::rendering
