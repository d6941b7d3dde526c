// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "services/rendering/palette.h"

namespace vorocast::rendering {
namespace {

using geometry::Vec3f;

// Rays a pixel: kSamples through the lens, and for each some to the key light and kSkyRays to the sky. A large shadow on the bare ground
// shows grain that a coloured surface hides, and rays from there mostly meet nothing, which costs little.
constexpr int kSamples = 4;
constexpr int kSkyRays = 4;
constexpr int kKeyRaysGround = 4;
constexpr int kKeyRaysSurface = 1;
/// Rotated grid: its four rows and columns are all different, which smooths near-vertical and near-horizontal edges best.
constexpr std::array<std::array<float, 2>, kSamples> kLens = {{{0.125F, 0.625F}, {0.375F, 0.125F}, {0.625F, 0.875F}, {0.875F, 0.375F}}};

constexpr float kKeyAzimuth = -0.85F;   // radians from the camera, to its left
constexpr float kKeyElevation = 0.85F;  // radians
constexpr float kKeyRadius = 0.10F;     // radians: softness of shadows
Vec3f KeyColour() { return {1.22F, 1.15F, 1.05F}; }
Vec3f SkyColour() { return {0.66F, 0.70F, 0.76F}; }
constexpr float kGroundGlow = 0.62F;  // light from below, as a part of the sky's
constexpr float kSkyReach = 0.40F;    // ambient shadows reach this far, in units of the extent
constexpr float kFar = 1e4F;

float Wrap(float x) { return x - std::floor(x); }

/// Two numbers in [0, 1) for a pixel. Interleaved gradient noise (Jimenez 2014): neighbours differ so evenly that what is left of it looks
/// like fine grain and not like dirt.
struct Jitter {
  float u, v;
  Jitter(std::int32_t column, std::int32_t row) : u(Noise(column, row)), v(Noise(column + 37, row + 17)) {}

  static float Noise(std::int32_t column, std::int32_t row) {
    return Wrap(52.9829189F * Wrap(0.06711056F * static_cast<float>(column) + 0.00583715F * static_cast<float>(row)));
  }
};

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

/// Renders one picture; holds what does not change from pixel to pixel.
class Painter {
 public:
  Painter(const Scene& scene, const Camera& camera, const Studio& studio) : scene_(scene), camera_(camera), studio_(studio) {
    const Vec3f towards(-camera.forward.x(), 0, -camera.forward.z());
    const float azimuth = std::atan2(towards.x(), towards.z()) + kKeyAzimuth;
    key_ = {std::sin(azimuth) * std::cos(kKeyElevation), std::sin(kKeyElevation), std::cos(azimuth) * std::cos(kKeyElevation)};
  }

  /// Linear colour.
  Vec3f Pixel(std::int32_t column, std::int32_t row, const Vec3f& backdrop) const {
    const Jitter jitter(column, row);
    Vec3f sum = Vec3f::Zero();
    for (int sample = 0; sample < kSamples; ++sample) {
      const auto& lens = kLens[static_cast<std::size_t>(sample)];
      const Ray ray = camera_.Through(static_cast<float>(column) + lens[0], static_cast<float>(row) + lens[1], kFar);
      sum += Sample(ray, sample, jitter, backdrop);
    }
    return sum / kSamples;
  }

 private:
  Vec3f Sample(const Ray& ray, int sample, const Jitter& jitter, const Vec3f& backdrop) const {
    const float to_ground = ray.direction.y() < 0 ? (studio_.ground - ray.origin.y()) / ray.direction.y() : -1;
    const auto hit = scene_.Intersect(ray);
    if (hit && (to_ground < 0 || hit->distance < to_ground + hit->clearance)) return Surface(ray, *hit, sample, jitter);
    if (to_ground < 0) return backdrop;
    return Ground(ray.origin + to_ground * ray.direction, sample, jitter, backdrop);
  }

  Vec3f Surface(const Ray& ray, const Hit& hit, int sample, const Jitter& jitter) const {
    // A surface seen from behind is drawn dull: it says that something is open or turned inside out.
    const bool behind = hit.normal.dot(ray.direction) > 0;
    const Vec3f normal = behind ? Vec3f(-hit.normal) : hit.normal;
    const Vec3f colour = behind ? Vec3f(0.35F * hit.colour + Vec3f(0.03F, 0.04F, 0.06F)) : hit.colour;
    const Vec3f from = ray.origin + hit.distance * ray.direction + hit.clearance * normal;
    const Vec3f key = Key(from, normal, kKeyRaysSurface, sample, jitter) * KeyColour();
    const Vec3f light = key * std::max(normal.dot(key_), 0.0F) + Sky(from, normal, sample, jitter);
    if (!hit.metal) return Expose(colour.cwiseProduct(light));
    const Vec3f mirrored = ray.direction - 2 * normal.dot(ray.direction) * normal;
    const float grazing = std::pow(1 - std::abs(normal.dot(ray.direction)), 5.0F);
    const float gloss = std::pow(std::max(mirrored.dot(key_), 0.0F), 40.0F);
    return Expose(0.7F * colour.cwiseProduct(light) + (0.22F + 0.6F * grazing) * SkyLight(mirrored) + 0.8F * gloss * key);
  }

  /// The backdrop, darkened by what the subject keeps from it: nothing shows where nothing is in the way.
  Vec3f Ground(const Vec3f& point, int sample, const Jitter& jitter, const Vec3f& backdrop) const {
    const Vec3f up = Vec3f::UnitY();
    const Vec3f from = point + 1e-4F * up;
    const Vec3f open = key_.y() * KeyColour() + OpenSky();
    const Vec3f light = Key(from, up, kKeyRaysGround, sample, jitter) * key_.y() * KeyColour() + Sky(from, up, sample, jitter);
    if (light == open) return backdrop;
    return backdrop.cwiseProduct(light.cwiseQuotient(open).cwiseMin(1.0F));
  }

  /// How much of the key light's disc is seen, 0 … 1.
  float Key(const Vec3f& from, const Vec3f& normal, int rays, int sample, const Jitter& jitter) const {
    if (normal.dot(key_) <= 0) return 0;
    const Frame frame(key_);
    const int total = rays * kSamples;
    int seen = 0;
    for (int i = 0; i < rays; ++i) {
      // Over the pixel, rings of equal area and angles a golden ratio apart.
      const auto k = static_cast<float>(sample + i * kSamples);
      const auto disc = Disc2(Wrap((k + jitter.v) / static_cast<float>(total)), Wrap(jitter.u + 0.618034F * k));
      const Vec3f direction = (key_ + kKeyRadius * (disc[0] * frame.x + disc[1] * frame.y)).normalized();
      seen += scene_.Occludes({.origin = from, .direction = direction, .reach = kFar}) ? 0 : 1;
    }
    return static_cast<float>(seen) / static_cast<float>(rays);
  }

  /// Light of the sky over the hemisphere of a normal, cosine-weighted.
  Vec3f Sky(const Vec3f& from, const Vec3f& normal, int sample, const Jitter& jitter) const {
    const Frame frame(normal);
    Vec3f sum = Vec3f::Zero();
    bool open = true;
    for (int i = 0; i < kSkyRays; ++i) {
      // Over the pixel's samples the 16 rays fill a 4 × 4 grid, each sample one cell of every row and column.
      const float u = Wrap((static_cast<float>(i) + jitter.u) / kSkyRays);
      const float v = Wrap((static_cast<float>((i + sample) % kSkyRays) + jitter.v) / kSkyRays + 0.0625F * static_cast<float>(i));
      const auto disc = Disc2(u, v);
      const Vec3f direction = disc[0] * frame.x + disc[1] * frame.y + std::sqrt(std::max(1 - u, 0.0F)) * normal;
      if (scene_.Occludes({.origin = from, .direction = direction, .reach = kSkyReach * studio_.extent})) {
        open = false;
      } else {
        sum += SkyLight(direction);
      }
    }
    return open && normal == Vec3f::UnitY() ? OpenSky() : Vec3f(sum / kSkyRays);
  }

  /// What Sky comes to over open ground: the mean of SkyLight over the upper hemisphere, cosine-weighted (mean of the height is 2/3).
  static Vec3f OpenSky() { return SkyColour() * (0.85F + 0.3F * 2 / 3); }

  /// Bright light bends towards white instead of breaking off.
  static Vec3f Expose(const Vec3f& colour) {
    Vec3f result;
    for (int i = 0; i < 3; ++i) result[i] = colour[i] < 0.7F ? colour[i] : 1 - 0.3F * std::exp((0.7F - colour[i]) / 0.3F);
    return result;
  }

  const Scene& scene_;
  const Camera& camera_;
  const Studio& studio_;
  Vec3f key_;  // unit, towards the light
};

Vec3f LinearBackdrop(std::int32_t row, std::int32_t height) {
  const float t = (static_cast<float>(row) + 0.5F) / static_cast<float>(height);
  return (1 - t) * Vec3f(0.76F, 0.79F, 0.83F) + t * Vec3f(0.89F, 0.89F, 0.88F);
}

}  // namespace

geometry::Rgb8 Backdrop(std::int32_t row, std::int32_t height) { return Rgb8FromLinear(LinearBackdrop(row, height)); }

Image RenderPicture(const Scene& scene, const Camera& camera, const Studio& studio, const base::Progress& progress) {
  Image image{.width = camera.width, .height = camera.height, .rgb = {}};
  image.rgb.reserve(3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  const Painter painter(scene, camera, studio);
  for (std::int32_t row = 0; row < camera.height; ++row) {
    const Vec3f backdrop = LinearBackdrop(row, camera.height);
    for (std::int32_t column = 0; column < camera.width; ++column) {
      const geometry::Rgb8 pixel = Rgb8FromLinear(painter.Pixel(column, row, backdrop));
      image.rgb.insert(image.rgb.end(), pixel.begin(), pixel.end());
    }
    base::Report(progress, static_cast<double>(row + 1) / camera.height);
  }
  return image;
}

}  // namespace vorocast::rendering
