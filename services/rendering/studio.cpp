// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/studio.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace vorocast::rendering {
namespace {

using geometry::Vec3f;

constexpr float kKeyAzimuth = -0.85F;   // radians from the camera, to its left
constexpr float kKeyElevation = 0.85F;  // radians
constexpr float kKeyRadius = 0.10F;     // radians: softness of shadows
Vec3f KeyColour() { return {1.22F, 1.15F, 1.05F}; }
Vec3f SkyColour() { return {0.66F, 0.70F, 0.76F}; }
constexpr float kGroundGlow = 0.62F;  // light from below, as a part of the sky's
constexpr float kSkyReach = 0.40F;    // ambient shadows reach this far, in units of the extent
constexpr float kFar = 1e4F;

float Wrap(float x) { return x - std::floor(x); }

float GradientNoise(std::int32_t column, std::int32_t row) {
  return Wrap(52.9829189F * Wrap(0.06711056F * static_cast<float>(column) + 0.00583715F * static_cast<float>(row)));
}

/// Two axes that span the plane of a unit vector (Duff et al. 2017).
struct Frame {
  Vec3f x, y;
  explicit Frame(const Vec3f& n) {
    const float sign = std::copysign(1.0F, n.z());
    const float a = -1 / (sign + n.z());
    const float b = n.x() * n.y() * a;
    x = {1 + sign * n.x() * n.x() * a, sign * b, -sign * n.x()};
    y = {b, sign + n.y() * n.y() * a, -n.y()};
  }
};

/// A point of the unit disc, equal areas to equal areas.
std::array<float, 2> Disc2(float u, float v) {
  const float radius = std::sqrt(u);
  const float angle = 2 * std::numbers::pi_v<float> * v;
  return {radius * std::cos(angle), radius * std::sin(angle)};
}

Vec3f SkyLight(const Vec3f& direction) {
  const float up = direction.y();
  return up >= 0 ? Vec3f(SkyColour() * (0.85F + 0.3F * up)) : Vec3f(SkyColour() * (kGroundGlow + 0.23F * (1 + up)));
}

/// What the sky comes to over open ground: the mean of SkyLight over the upper hemisphere, cosine-weighted (mean of the height is 2/3).
Vec3f OpenSky() { return SkyColour() * (0.85F + 0.3F * 2 / 3); }

/// Bright light bends towards white instead of breaking off.
Vec3f Expose(const Vec3f& colour) {
  Vec3f result;
  for (int i = 0; i < 3; ++i) result[i] = colour[i] < 0.7F ? colour[i] : 1 - 0.3F * std::exp((0.7F - colour[i]) / 0.3F);
  return result;
}

}  // namespace

Jitter::Jitter(std::int32_t column, std::int32_t row) : u(GradientNoise(column, row)), v(GradientNoise(column + 37, row + 17)) {}

StudioLight::StudioLight(const Scene& scene, const Camera& camera, const Studio& studio, const LightRays& rays)
    : scene_(scene), studio_(studio), rays_(rays) {
  const Vec3f towards(-camera.forward.x(), 0, -camera.forward.z());
  const float azimuth = std::atan2(towards.x(), towards.z()) + kKeyAzimuth;
  key_ = {std::sin(azimuth) * std::cos(kKeyElevation), std::sin(kKeyElevation), std::cos(azimuth) * std::cos(kKeyElevation)};
}

Seen StudioLight::Look(const Ray& ray, int sample, const Jitter& jitter) const {
  const float to_ground = ray.direction.y() < 0 ? (studio_.ground - ray.origin.y()) / ray.direction.y() : -1;
  Seen seen;
  seen.hit = scene_.Intersect(ray);
  if (seen.hit && (to_ground < 0 || seen.hit->distance < to_ground + seen.hit->clearance)) {
    seen.colour = Surface(ray, *seen.hit, sample, jitter);
    return seen;
  }
  seen.hit.reset();
  if (to_ground >= 0) seen.unshadowed = Unshadowed(ray, ray.origin + to_ground * ray.direction, sample, jitter);
  return seen;
}

Vec3f StudioLight::Surface(const Ray& ray, const Hit& hit, int sample, const Jitter& jitter) const {
  // A surface seen from behind is drawn dull: it says that something is open or turned inside out.
  const bool behind = hit.normal.dot(ray.direction) > 0;
  const Vec3f normal = behind ? Vec3f(-hit.normal) : hit.normal;
  const Vec3f colour = behind ? Vec3f(0.35F * hit.colour + Vec3f(0.03F, 0.04F, 0.06F)) : hit.colour;
  const Vec3f from = ray.origin + hit.distance * ray.direction + hit.clearance * normal;
  const Vec3f key = Key(ray, from, normal, rays_.key_surface, sample, jitter) * KeyColour();
  const Vec3f light = key * std::max(normal.dot(key_), 0.0F) + Sky(ray, from, normal, sample, jitter);
  if (!hit.metal) return Expose(colour.cwiseProduct(light));
  const Vec3f mirrored = ray.direction - 2 * normal.dot(ray.direction) * normal;
  const float grazing = std::pow(1 - std::abs(normal.dot(ray.direction)), 5.0F);
  const float gloss = std::pow(std::max(mirrored.dot(key_), 0.0F), 40.0F);
  return Expose(0.7F * colour.cwiseProduct(light) + (0.22F + 0.6F * grazing) * SkyLight(mirrored) + 0.8F * gloss * key);
}

/// The scene's box, grown by a margin on every side.
bool StudioLight::MeetsBox(const Vec3f& from, const Vec3f& direction, float margin) const {
  const Vec3f inverse = direction.cwiseInverse();
  const Vec3f grown = Vec3f::Constant(margin);
  const Vec3f a = (scene_.low() - grown - from).cwiseProduct(inverse);
  const Vec3f b = (scene_.high() + grown - from).cwiseProduct(inverse);
  return std::max(a.cwiseMin(b).maxCoeff(), 0.0F) <= a.cwiseMax(b).minCoeff();
}

/// Most of the ground sees all of the light; knowing it from the scene's box saves sending rays. `margin`: of everything within so many metres.
bool StudioLight::IsFarFromAll(const Vec3f& from, float margin) const {
  const Vec3f& low = scene_.low();
  const Vec3f& high = scene_.high();
  if ((low.array() > high.array()).any()) return true;
  const Vec3f nearest = from.cwiseMax(low).cwiseMin(high);
  const float reach = kSkyReach * studio_.extent + margin;
  if ((nearest - from).squaredNorm() < reach * reach) return false;
  // The key light's cone widens by less than its radius times the way to the far end of the box; a box grown by that holds all it could meet.
  const float way = ((low + high) / 2 - from).norm() + (high - low).norm() / 2 + margin;
  return !MeetsBox(from, key_, 1.01F * kKeyRadius * way + margin);
}

bool StudioLight::SeesNothing(const Ray& ray, float spread) const {
  const Vec3f& low = scene_.low();
  const Vec3f& high = scene_.high();
  if ((low.array() <= high.array()).all()) {
    const float way = ((low + high) / 2 - ray.origin).norm() + (high - low).norm() / 2;
    if (MeetsBox(ray.origin, ray.direction, spread * way)) return false;
  }
  if (ray.direction.y() >= spread) return true;
  if (ray.direction.y() > -2 * spread) return false;  // along the horizon a little aside is far away on the ground
  const float to_ground = (studio_.ground - ray.origin.y()) / ray.direction.y();
  if (to_ground < 0) return true;  // from below
  return IsFarFromAll(ray.origin + to_ground * ray.direction, 4 * spread * to_ground / -ray.direction.y());
}

/// Nothing shows where nothing is in the way: there it is exactly one.
Vec3f StudioLight::Unshadowed(const Ray& ray, const Vec3f& point, int sample, const Jitter& jitter) const {
  const Vec3f up = Vec3f::UnitY();
  const Vec3f from = point + 1e-4F * up;
  if (IsFarFromAll(from, 0)) return Vec3f::Ones();
  const Vec3f open = key_.y() * KeyColour() + OpenSky();
  const Vec3f light = Key(ray, from, up, rays_.key_ground, sample, jitter) * key_.y() * KeyColour() + Sky(ray, from, up, sample, jitter);
  if (light == open) return Vec3f::Ones();
  return light.cwiseQuotient(open).cwiseMin(1.0F);
}

/// How much of the key light's disc is seen, 0 … 1.
float StudioLight::Key(const Ray& ray, const Vec3f& from, const Vec3f& normal, int rays, int sample, const Jitter& jitter) const {
  if (normal.dot(key_) <= 0) return 0;
  const Frame frame(key_);
  const int total = rays * rays_.samples;
  int seen = 0;
  for (int i = 0; i < rays; ++i) {
    // Over the pixel, rings of equal area and angles a golden ratio apart.
    const auto k = static_cast<float>(sample + i * rays_.samples);
    const auto disc = Disc2(Wrap((k + jitter.v) / static_cast<float>(total)), Wrap(jitter.u + 0.618034F * k));
    const Vec3f direction = (key_ + kKeyRadius * (disc[0] * frame.x + disc[1] * frame.y)).normalized();
    seen += scene_.Occludes({.origin = from, .direction = direction, .reach = kFar, .time = ray.time}) ? 0 : 1;
  }
  return static_cast<float>(seen) / static_cast<float>(rays);
}

/// Light of the sky over the hemisphere of a normal, cosine-weighted.
Vec3f StudioLight::Sky(const Ray& ray, const Vec3f& from, const Vec3f& normal, int sample, const Jitter& jitter) const {
  const Frame frame(normal);
  const auto count = static_cast<float>(rays_.sky);
  Vec3f sum = Vec3f::Zero();
  bool open = true;
  for (int i = 0; i < rays_.sky; ++i) {
    // Over the pixel's samples the rays fill a square grid, each sample one cell of every row and column.
    const float u = Wrap((static_cast<float>(i) + jitter.u) / count);
    const float v = Wrap((static_cast<float>((i + sample) % rays_.sky) + jitter.v) / count + static_cast<float>(i) / (count * count));
    const auto disc = Disc2(u, v);
    const Vec3f direction = disc[0] * frame.x + disc[1] * frame.y + std::sqrt(std::max(1 - u, 0.0F)) * normal;
    if (scene_.Occludes({.origin = from, .direction = direction, .reach = kSkyReach * studio_.extent, .time = ray.time})) {
      open = false;
    } else {
      sum += SkyLight(direction);
    }
  }
  return open && normal == Vec3f::UnitY() ? OpenSky() : Vec3f(sum / count);
}

Vec3f LinearBackdrop(std::int32_t row, std::int32_t height) {
  const float t = (static_cast<float>(row) + 0.5F) / static_cast<float>(height);
  return (1 - t) * Vec3f(0.76F, 0.79F, 0.83F) + t * Vec3f(0.89F, 0.89F, 0.88F);
}

}  // namespace vorocast::rendering
