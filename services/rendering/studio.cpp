// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/studio.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "services/base/check.h"
#include "services/base/random.h"

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
constexpr int kFirstRays = 32;  // from a patch of the ground, of each kind

float Wrap(float x) { return x - std::floor(x); }
float Fraction(double x) { return static_cast<float>(x - std::floor(x)); }

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

/// The first points of Sobol's sequence in the square, every 2^m of which are spread evenly over it, shifted digit by digit: sets of different
/// seeds know nothing of each other and are as even.
class DigitalNet {
 public:
  explicit DigitalNet(std::uint64_t seed) : x_(static_cast<std::uint32_t>(seed)), y_(static_cast<std::uint32_t>(seed >> 32)) {}

  std::array<float, 2> Point(int k) const {
    std::uint32_t x = x_;
    std::uint32_t y = y_;
    std::uint32_t of_y = 1U << 31;
    for (std::uint32_t i = static_cast<std::uint32_t>(k), of_x = 1U << 31; i != 0; i >>= 1, of_x >>= 1, of_y ^= of_y >> 1) {
      if ((i & 1U) != 0) x ^= of_x, y ^= of_y;
    }
    return {static_cast<float>(x >> 8) * 0x1p-24F, static_cast<float>(y >> 8) * 0x1p-24F};
  }

 private:
  std::uint32_t x_, y_;
};

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
  VOROCAST_CHECK(rays.key >= 1 && rays.key <= LightRays::kKeyMax && rays.sky >= 1 && rays.sky <= LightRays::kSkyMax);
  const Vec3f towards(-camera.forward.x(), 0, -camera.forward.z());
  const float azimuth = std::atan2(towards.x(), towards.z()) + kKeyAzimuth;
  key_ = {std::sin(azimuth) * std::cos(kKeyElevation), std::sin(kKeyElevation), std::cos(azimuth) * std::cos(kKeyElevation)};
  const Frame frame(key_);
  key_x_ = frame.x;
  key_y_ = frame.y;
}

std::optional<Vec3f> StudioLight::OnGround(const Ray& ray) const {
  if (ray.direction.y() >= 0 || ray.origin.y() < studio_.ground) return std::nullopt;
  return Vec3f(ray.origin + (studio_.ground - ray.origin.y()) / ray.direction.y() * ray.direction);
}

void StudioLight::Look(std::span<const Ray> rays, std::span<std::optional<Hit>> hits) const {
  scene_.Intersect(rays, hits);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!hits[i]) continue;
    const auto ground = OnGround(rays[i]);
    if (ground && (*ground - rays[i].origin).norm() + hits[i]->clearance <= hits[i]->distance) hits[i].reset();
  }
}

struct StudioLight::Open {
  Vec3f normal, colour;
  std::size_t first;  // of the rays sent on: those to the key light, then those to the sky
  int key;
};

void StudioLight::Shade(std::span<Lit> hits, const Jitter& jitter) const {
  VOROCAST_CHECK(hits.size() <= kShadeMax);
  std::array<Open, kShadeMax> open;
  std::array<Ray, kShadeMax*(LightRays::kKeyMax + LightRays::kSkyMax)> sent;
  std::size_t count = 0;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const Hit& hit = hits[i].hit;
    // A surface seen from behind is drawn dull: it says that something is open or turned inside out.
    const bool behind = hit.normal.dot(hits[i].ray.direction) > 0;
    open[i].normal = behind ? Vec3f(-hit.normal) : hit.normal;
    open[i].colour = behind ? Vec3f(0.35F * hit.colour + Vec3f(0.03F, 0.04F, 0.06F)) : hit.colour;
    open[i].first = count;
    open[i].key = open[i].normal.dot(key_) > 0 ? rays_.key : 0;
    SendOn(hits[i], jitter, open[i], std::span(sent).subspan(count));
    count += static_cast<std::size_t>(open[i].key + rays_.sky);
  }
  std::array<std::uint8_t, sent.size()> blocked;
  scene_.Occludes(std::span(sent).first(count), blocked);
  for (std::size_t i = 0; i < hits.size(); ++i) hits[i].colour = Gather(hits[i], open[i], sent, blocked);
}

/// Rays from a hit to the key light's disc, and into the hemisphere of its normal, the more of them the more light comes from there.
void StudioLight::SendOn(const Lit& lit, const Jitter& jitter, Open& open, std::span<Ray> sent) const {
  const Vec3f origin = lit.ray.origin + lit.hit.distance * lit.ray.direction + lit.hit.clearance * open.normal;
  std::size_t count = 0;
  const int total = rays_.key * rays_.samples;
  for (int i = 0; i < open.key; ++i) {
    // Over the pixel, rings of equal area and angles a golden ratio apart.
    const auto k = static_cast<float>(lit.sample + i * rays_.samples);
    const auto disc = Disc2(Wrap((k + jitter.v) / static_cast<float>(total)), Wrap(jitter.u + 0.618034F * k));
    sent[count++] = {.origin = origin, .direction = KeyDirection(disc), .reach = kFar, .time = lit.ray.time};
  }
  const Frame frame(open.normal);
  for (int i = 0; i < rays_.sky; ++i) {
    // All of a pixel's rays to the sky are one sequence that fills the square evenly, another one than that of its places on the lens (R4, Roberts).
    const double k = lit.sample * rays_.sky + i;
    const float u = Fraction(jitter.u + 0.8566748838545029 * k);
    const float v = Fraction(jitter.v + 0.7338918566271260 * k);
    const auto disc = Disc2(u, v);
    const Vec3f direction = disc[0] * frame.x + disc[1] * frame.y + std::sqrt(std::max(1 - u, 0.0F)) * open.normal;
    sent[count++] = {.origin = origin, .direction = direction, .reach = kSkyReach * studio_.extent, .time = lit.ray.time};
  }
}

Vec3f StudioLight::Gather(const Lit& lit, const Open& open, std::span<const Ray> sent, std::span<const std::uint8_t> blocked) const {
  int key_seen = 0;
  const std::size_t first_sky = open.first + static_cast<std::size_t>(open.key);
  for (std::size_t i = open.first; i < first_sky; ++i) key_seen += blocked[i] != 0 ? 0 : 1;
  const Vec3f key = open.key == 0 ? Vec3f(Vec3f::Zero()) : Vec3f(static_cast<float>(key_seen) / static_cast<float>(open.key) * KeyColour());
  Vec3f sky = Vec3f::Zero();
  for (std::size_t i = first_sky; i < first_sky + static_cast<std::size_t>(rays_.sky); ++i) {
    if (blocked[i] == 0) sky += SkyLight(sent[i].direction);
  }
  const Vec3f light = key * std::max(open.normal.dot(key_), 0.0F) + sky / static_cast<float>(rays_.sky);
  if (!lit.hit.metal) return Expose(open.colour.cwiseProduct(light));
  const Vec3f& direction = lit.ray.direction;
  const Vec3f mirrored = direction - 2 * open.normal.dot(direction) * open.normal;
  const float grazing = std::pow(1 - std::abs(open.normal.dot(direction)), 5.0F);
  const float gloss = std::pow(std::max(mirrored.dot(key_), 0.0F), 40.0F);
  return Expose(0.7F * open.colour.cwiseProduct(light) + (0.22F + 0.6F * grazing) * SkyLight(mirrored) + 0.8F * gloss * key);
}

Vec3f StudioLight::KeyDirection(const std::array<float, 2>& disc) const {
  return (key_ + kKeyRadius * (disc[0] * key_x_ + disc[1] * key_y_)).normalized();
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

Vec3f StudioLight::Unshadowed(const GroundPatch& patch, int rays, bool moving, std::uint64_t seed) const {
  VOROCAST_CHECK(rays >= kFirstRays && rays <= kGroundRaysMax);
  const Vec3f up = Vec3f::UnitY();
  if (IsFarFromAll(patch.middle, 0.5F * (patch.across.norm() + patch.along.norm()))) return Vec3f::Ones();
  // Three sets of points that know nothing of each other: of the patch, of the key light's disc, and of the hemisphere; and a set of instants.
  base::Random random(seed);
  const DigitalNet of_patch(random.Bits());
  const DigitalNet of_key(random.Bits());
  const DigitalNet of_sky(random.Bits());
  const auto first_instant = static_cast<float>(random.Uniform());
  std::array<Ray, kGroundRaysMax> sent;
  std::array<std::uint8_t, kGroundRaysMax> blocked;
  const auto from = [&](int k) {
    const auto place = of_patch.Point(k);
    return Ray{.origin = patch.middle + (place[0] - 0.5F) * patch.across + (place[1] - 0.5F) * patch.along + 1e-4F * up,
               .time = moving ? Wrap(first_instant + 0.618034F * static_cast<float>(k)) : 0};
  };
  const auto send = [&](int begin, int end, const auto& aim) {
    for (int k = begin; k < end; ++k) {
      Ray& ray = sent[static_cast<std::size_t>(k)] = from(k);
      aim(k, ray);
    }
    const auto count = static_cast<std::size_t>(end - begin);
    scene_.Occludes(std::span(sent).subspan(static_cast<std::size_t>(begin), count), std::span(blocked).subspan(static_cast<std::size_t>(begin)));
    return static_cast<int>(std::count(blocked.begin() + begin, blocked.begin() + end, std::uint8_t{1}));
  };

  // Where the first rays all say the same, they are believed.
  const auto to_key = [&](int k, Ray& ray) {
    const auto point = of_key.Point(k);
    ray.direction = KeyDirection(Disc2(point[0], point[1]));
    ray.reach = kFar;
  };
  int key_blocked = send(0, kFirstRays, to_key);
  int key_rays = kFirstRays;
  if (key_blocked > 0 && key_blocked < kFirstRays) {
    key_blocked += send(kFirstRays, rays, to_key);
    key_rays = rays;
  }
  const Frame frame(up);
  const auto to_sky = [&](int k, Ray& ray) {
    const auto point = of_sky.Point(k);
    const auto disc = Disc2(point[0], point[1]);
    ray.direction = disc[0] * frame.x + disc[1] * frame.y + std::sqrt(std::max(1 - point[0], 0.0F)) * up;
    ray.reach = kSkyReach * studio_.extent;
  };
  int sky_blocked = send(0, kFirstRays, to_sky);
  int sky_rays = kFirstRays;
  if (sky_blocked > 0 && sky_blocked < kFirstRays) {
    sky_blocked += send(kFirstRays, rays, to_sky);
    sky_rays = rays;
  }
  if (key_blocked == 0 && sky_blocked == 0) return Vec3f::Ones();
  // What is blocked is taken away: the rest of the sky needs no sum of its own, and its noise is that of the blocked part only.
  Vec3f dark = static_cast<float>(key_blocked) / static_cast<float>(key_rays) * key_.y() * KeyColour();
  for (std::size_t k = 0; k < static_cast<std::size_t>(sky_rays); ++k) {
    if (blocked[k] != 0) dark += SkyLight(sent[k].direction) / static_cast<float>(sky_rays);
  }
  const Vec3f open = key_.y() * KeyColour() + OpenSky();
  return (Vec3f::Ones() - dark.cwiseQuotient(open)).cwiseMax(0.0F);
}

Vec3f LinearBackdrop(std::int32_t row, std::int32_t height) {
  const float t = (static_cast<float>(row) + 0.5F) / static_cast<float>(height);
  return (1 - t) * Vec3f(0.76F, 0.79F, 0.83F) + t * Vec3f(0.89F, 0.89F, 0.88F);
}

}  // namespace vorocast::rendering
