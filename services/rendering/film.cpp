// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/film.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "services/rendering/film_scene.h"
#include "services/rendering/palette.h"

namespace vorocast::rendering {
namespace {

using geometry::Vec3f;

constexpr double kPixelsMax = 2e8;
constexpr float kFar = 1e4F;
constexpr int kRefined = 4;           // so many times more rays where a pixel is not of one piece
constexpr float kStillPixels = 0.5F;  // what moves less than this while the shutter is open is not blurred
constexpr int kRefinedSamplesMax = 64;

/// The k-th of a sequence that fills the unit square evenly, however many are taken of it (R2, Roberts 2018); both start at the pixel's jitter.
std::array<float, 2> LensPoint(int k, const Jitter& jitter) {
  const auto fraction = [](double x) { return static_cast<float>(x - std::floor(x)); };
  return {fraction(jitter.u + 0.7548776662466927 * k), fraction(jitter.v + 0.5698402909980532 * k)};
}

/// Instants within the shutter are not to go with the place on the lens, so they come from a sequence of their own.
float ShutterTime(int k, const Jitter& jitter) {
  const double x = jitter.u + jitter.v + 0.6180339887498949 * k;
  return static_cast<float>(x - std::floor(x));
}

/// A pixel while its rays come in.
class PixelSum {
 public:
  void Add(const Seen& seen, std::int32_t id, float depth) {
    ++rays_;
    if (!seen.hit) {
      shadow_ += seen.unshadowed;
      ++open_;
      return;
    }
    colour_ += seen.colour;
    if (depth < depth_) {
      depth_ = depth;
      nearest_ = *seen.hit;
    }
    for (Counted& counted : counted_) {
      if (counted.rays > 0 && counted.id != id) continue;
      counted.id = id;
      ++counted.rays;
      return;
    }
  }

  int rays() const { return rays_; }
  bool IsOfOnePiece() const { return open_ == rays_ || counted_[0].rays == rays_; }
  bool HasHit() const { return open_ < rays_; }
  float depth() const { return depth_; }
  const Hit& nearest() const { return nearest_; }

  std::array<float, 4> Rgba() const {
    const auto n = static_cast<float>(rays_);
    return {colour_.x() / n, colour_.y() / n, colour_.z() / n, static_cast<float>(rays_ - open_) / n};
  }
  Vec3f Shadow() const { return open_ == 0 ? Vec3f(Vec3f::Ones()) : Vec3f(shadow_ / static_cast<float>(open_)); }

  std::array<FilmPicture::Coverage, 6> Coverage() {
    std::ranges::stable_sort(counted_,
                             [](const Counted& a, const Counted& b) { return a.rays != b.rays ? a.rays > b.rays : a.rays > 0 && a.id < b.id; });
    std::array<FilmPicture::Coverage, 6> coverage{};
    for (std::size_t i = 0; i < coverage.size(); ++i)
      coverage[i] = {counted_[i].id, static_cast<float>(counted_[i].rays) / static_cast<float>(rays_)};
    return coverage;
  }

 private:
  struct Counted {
    std::int32_t id = 0;
    int rays = 0;
  };
  int rays_ = 0;
  int open_ = 0;  // rays that met nothing but the ground or the backdrop
  Vec3f colour_ = Vec3f::Zero();
  Vec3f shadow_ = Vec3f::Zero();
  float depth_ = std::numeric_limits<float>::infinity();
  Hit nearest_;
  std::array<Counted, 16> counted_{};  // a pixel with more pieces than this loses the smallest ones
};

/// Where a pixel takes many camera rays, each sends on fewer.
struct Lights {
  StudioLight even;
  StudioLight refined;
};

int RefinedSamples(const FilmQuality& quality) { return std::min(kRefinedSamplesMax, kRefined * quality.samples); }

class FilmCamera {
 public:
  FilmCamera(const FilmScene& scene, const Lights& lights, const Camera& camera, const FilmQuality& quality, double seconds_per_picture)
      : scene_(scene),
        lights_(lights),
        camera_(camera),
        quality_(quality),
        seconds_(seconds_per_picture),
        blurred_(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height)) {}

  /// Marks the pixels that something moving may cross while the shutter is open: few rays would miss what is there only for a moment.
  void FindBlur() {
    if (quality_.shutter <= 0) return;
    for (std::int32_t row = 0; row < camera_.height; ++row) {
      for (std::int32_t column = 0; column < camera_.width; ++column) {
        Ray ray = camera_.Through(static_cast<float>(column) + 0.5F, static_cast<float>(row) + 0.5F, kFar);
        ray.time = 0.5F;
        const auto hit = scene_.rays().Intersect(ray);
        if (!hit) continue;
        const Vec3f point = ray.origin + hit->distance * ray.direction;
        const auto moved = PixelsBetween(point, scene_.OnePictureLater(*hit, point));
        const float reach = 0.5F * static_cast<float>(quality_.shutter);
        if (std::hypot(moved[0], moved[1]) * reach > kStillPixels / 2) MarkLine(column, row, reach * moved[0], -reach * moved[1]);
      }
    }
  }

  void Expose(std::int32_t column, std::int32_t row, FilmPicture& picture) const {
    const Ray middle = camera_.Through(static_cast<float>(column) + 0.5F, static_cast<float>(row) + 0.5F, kFar);
    if (lights_.even.SeesNothing(middle, camera_.pixel)) return;
    const Jitter jitter(column, row);
    PixelSum sum;
    const std::size_t at = At(column, row);
    if (!blurred_[at]) AddRays(lights_.even, quality_.samples, column, row, jitter, sum);
    if (blurred_[at] || !sum.IsOfOnePiece()) AddRays(lights_.refined, RefinedSamples(quality_) - sum.rays(), column, row, jitter, sum);
    picture.rgba[at] = sum.Rgba();
    picture.shadow[at] = sum.Shadow();
    if (!sum.HasHit()) return;
    picture.coverage[at] = sum.Coverage();
    const Hit& hit = sum.nearest();
    const Vec3f point = middle.origin + sum.depth() / middle.direction.dot(camera_.forward) * middle.direction;
    picture.depth[at] = sum.depth();
    picture.normal[at] = hit.normal.dot(middle.direction) > 0 ? Vec3f(-hit.normal) : hit.normal;
    const Vec3f next = scene_.OnePictureLater(hit, point);
    picture.velocity[at] = (next - point) / static_cast<float>(seconds_);
    picture.forward[at] = PixelsBetween(point, next);
    const std::int32_t id = scene_.IdOf(hit);
    picture.cell[at] = id;
    picture.patch[at] = id >= 0 ? scene_.PatchOf(id) : -1;
  }

 private:
  std::size_t At(std::int32_t column, std::int32_t row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(camera_.width) + static_cast<std::size_t>(column);
  }

  /// From a pixel as far as (dx, dy), both ways, and the pixels beside.
  void MarkLine(std::int32_t column, std::int32_t row, float dx, float dy) {
    const int steps = std::min(static_cast<int>(std::ceil(std::hypot(dx, dy))) + 1, camera_.width + camera_.height);
    for (int i = -steps; i <= steps; ++i) {
      const float t = static_cast<float>(i) / static_cast<float>(steps);
      const auto middle_x = column + static_cast<std::int32_t>(std::lround(t * dx));
      const auto middle_y = row + static_cast<std::int32_t>(std::lround(t * dy));
      for (std::int32_t y = std::max(middle_y - 1, 0); y <= std::min(middle_y + 1, camera_.height - 1); ++y) {
        for (std::int32_t x = std::max(middle_x - 1, 0); x <= std::min(middle_x + 1, camera_.width - 1); ++x) blurred_[At(x, y)] = true;
      }
    }
  }

  void AddRays(const StudioLight& light, int count, std::int32_t column, std::int32_t row, const Jitter& jitter, PixelSum& sum) const {
    for (int i = 0; i < count; ++i) {
      const int k = sum.rays();
      const auto lens = LensPoint(k, jitter);
      Ray ray = camera_.Through(static_cast<float>(column) + lens[0], static_cast<float>(row) + lens[1], kFar);
      ray.time = quality_.shutter > 0 ? ShutterTime(k, jitter) : 0;
      const Seen seen = light.Look(ray, k, jitter);
      sum.Add(seen, seen.hit ? scene_.IdOf(*seen.hit) : 0, seen.hit ? seen.hit->distance * ray.direction.dot(camera_.forward) : 0);
    }
  }

  /// Right and up.
  std::array<float, 2> PixelsBetween(const Vec3f& from, const Vec3f& to) const {
    const auto project = [&](const Vec3f& x) -> Eigen::Vector2f {
      const Vec3f arm = x - camera_.eye;
      const float depth = std::max(arm.dot(camera_.forward), 1e-3F);
      return Eigen::Vector2f(arm.dot(camera_.right), arm.dot(camera_.up)) / (depth * camera_.pixel);
    };
    const Eigen::Vector2f moved = project(to) - project(from);
    return {moved.x(), moved.y()};
  }

  const FilmScene& scene_;
  const Lights& lights_;
  const Camera& camera_;
  const FilmQuality& quality_;
  double seconds_;
  std::vector<bool> blurred_;
};

absl::Status Check(const Camera& camera, const FilmQuality& quality) {
  if (camera.width < 1 || camera.height < 1 || static_cast<double>(camera.width) * camera.height > kPixelsMax) {
    return absl::InvalidArgumentError(
        fmt::format("a picture of {} × {} pixels: choose at least 1 × 1, at most 200 million in all", camera.width, camera.height));
  }
  if (quality.samples < 1 || quality.samples > kRefinedSamplesMax) {
    return absl::InvalidArgumentError(fmt::format("{} samples a pixel: choose 1 to {}", quality.samples, kRefinedSamplesMax));
  }
  if (!(quality.shutter >= 0 && quality.shutter <= 1)) {
    return absl::InvalidArgumentError(fmt::format("a shutter open for {} of a picture: choose 0 (no motion blur) to 1", quality.shutter));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<FilmPicture> RenderFilmPicture(const FilmSubject& subject, const Camera& camera, const Studio& studio, const FilmQuality& quality,
                                              const base::Progress& progress) {
  RETURN_IF_ERROR(Check(camera, quality));
  ASSIGN_OR_RETURN(const FilmScene scene, FilmScene::Build(subject, quality.shutter > 0));
  const Lights lights = {
      StudioLight(scene.rays(), camera, studio, {.samples = quality.samples, .sky = 3, .key_ground = 3, .key_surface = 1}),
      StudioLight(scene.rays(), camera, studio, {.samples = RefinedSamples(quality), .sky = 1, .key_ground = 1, .key_surface = 1}),
  };
  FilmCamera film(scene, lights, camera, quality, subject.seconds_per_picture);
  film.FindBlur();
  FilmPicture picture;
  picture.width = camera.width;
  picture.height = camera.height;
  const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  picture.rgba.resize(pixels);
  picture.shadow.resize(pixels, Vec3f::Ones());
  picture.depth.resize(pixels, std::numeric_limits<float>::infinity());
  picture.normal.resize(pixels, Vec3f::Zero());
  picture.velocity.resize(pixels, Vec3f::Zero());
  picture.forward.resize(pixels);
  picture.cell.resize(pixels, -1);
  picture.patch.resize(pixels, -1);
  picture.coverage.resize(pixels);
  for (std::int32_t row = 0; row < camera.height; ++row) {
    for (std::int32_t column = 0; column < camera.width; ++column) film.Expose(column, row, picture);
    base::Report(progress, static_cast<double>(row + 1) / camera.height);
  }
  return picture;
}

Image Develop(const FilmPicture& picture) {
  Image image{.width = picture.width, .height = picture.height, .rgb = {}};
  image.rgb.reserve(3 * picture.rgba.size());
  for (std::int32_t row = 0; row < picture.height; ++row) {
    const Vec3f backdrop = LinearBackdrop(row, picture.height);
    for (std::int32_t column = 0; column < picture.width; ++column) {
      const std::size_t at = static_cast<std::size_t>(row) * static_cast<std::size_t>(picture.width) + static_cast<std::size_t>(column);
      const auto& [r, g, b, a] = picture.rgba[at];
      const geometry::Rgb8 pixel = Rgb8FromLinear(Vec3f(r, g, b) + (1 - a) * backdrop.cwiseProduct(picture.shadow[at]));
      image.rgb.insert(image.rgb.end(), pixel.begin(), pixel.end());
    }
  }
  return image;
}

}  // namespace vorocast::rendering
