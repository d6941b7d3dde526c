// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/film.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "services/rendering/film_scene.h"
#include "services/rendering/ground_shadow.h"
#include "services/rendering/palette.h"

namespace vorocast::rendering {
namespace {

using geometry::Vec3f;

constexpr double kPixelsMax = 2e8;
constexpr float kFar = 1e4F;
constexpr int kRefined = 4;           // so many times more rays where a pixel is not of one piece
constexpr float kStillPixels = 0.5F;  // what moves less than this while the shutter is open is not blurred
constexpr int kRefinedSamplesMax = 64;
constexpr std::size_t kBatch = StudioLight::kShadeMax;  // rays looked along at once

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
  void AddOpen() {
    ++rays_;
    ++open_;
  }
  void Add(const Vec3f& colour, const Hit& hit, std::int32_t id, float depth) {
    ++rays_;
    colour_ += colour;
    if (depth < depth_) {
      depth_ = depth;
      nearest_ = hit;
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
  bool HasOpen() const { return open_ > 0; }
  float depth() const { return depth_; }
  const Hit& nearest() const { return nearest_; }

  std::array<float, 4> Rgba() const {
    const auto n = static_cast<float>(rays_);
    return {colour_.x() / n, colour_.y() / n, colour_.z() / n, static_cast<float>(rays_ - open_) / n};
  }

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
  float depth_ = std::numeric_limits<float>::infinity();
  Hit nearest_;
  std::array<Counted, 16> counted_{};  // a pixel with more pieces than this loses the smallest ones
};

/// The faces that a pixel's rays have met, each with the mean of its colours there. A seam or an edge takes many camera rays, but light hardly
/// changes over a pixel of a face, so that later rays need not ask for it again.
class PixelFaces {
 public:
  /// The face that a hit is on, or −1 if there is none yet.
  int Find(const Hit& hit, std::int32_t id) const {
    constexpr float kSameNormal = 0.9999F;
    for (int i = 0; i < count_; ++i) {
      const Face& face = faces_[static_cast<std::size_t>(i)];
      if (face.id == id && face.normal.dot(hit.normal) > kSameNormal) return i;
    }
    return -1;
  }
  void Add(const Hit& hit, std::int32_t id, const Vec3f& colour) {
    int at = Find(hit, id);
    if (at < 0) {
      at = count_++;
      faces_[static_cast<std::size_t>(at)] = {.id = id, .rays = 0, .normal = hit.normal, .sum = Vec3f::Zero()};
    }
    Face& face = faces_[static_cast<std::size_t>(at)];
    face.sum += colour;
    ++face.rays;
  }
  Vec3f Colour(int face) const {
    const Face& one = faces_[static_cast<std::size_t>(face)];
    return one.sum / static_cast<float>(one.rays);
  }

 private:
  struct Face {
    std::int32_t id;
    int rays;
    Vec3f normal;
    Vec3f sum;
  };
  std::array<Face, kRefinedSamplesMax> faces_;
  int count_ = 0;
};

/// Where rays meet things at different times, each sends on a few of its own; elsewhere the first rays of a pixel send on many.
struct Lights {
  StudioLight even;
  StudioLight blurred;
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
        shadow_(lights.even, camera, quality.shutter > 0, quality.samples),
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

  void Expose(std::int32_t column, std::int32_t row, FilmPicture& picture) {
    const Ray middle = camera_.Through(static_cast<float>(column) + 0.5F, static_cast<float>(row) + 0.5F, kFar);
    if (lights_.even.SeesNothing(middle, camera_.pixel)) return;
    const Jitter jitter(column, row);
    PixelSum sum;
    const std::size_t at = At(column, row);
    PixelFaces faces;
    if (blurred_[at]) {
      AddRays(lights_.blurred, RefinedSamples(quality_), RefinedSamples(quality_), column, row, jitter, faces, sum);
    } else {
      AddRays(lights_.even, quality_.samples, quality_.samples, column, row, jitter, faces, sum);
      if (!sum.IsOfOnePiece()) AddRays(lights_.even, RefinedSamples(quality_) - quality_.samples, quality_.samples, column, row, jitter, faces, sum);
    }
    picture.rgba[at] = sum.Rgba();
    if (sum.HasOpen()) picture.shadow[at] = shadow_.At(column, row);
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

  /// The pixel's next rays. The first `shaded` of all are shaded, and those that meet a face that none has met; others take their face's colour.
  void AddRays(const StudioLight& light, int count, int shaded, std::int32_t column, std::int32_t row, const Jitter& jitter, PixelFaces& faces,
               PixelSum& sum) const {
    std::array<Ray, kBatch> rays;
    std::array<std::optional<Hit>, kBatch> hits;
    std::array<Lit, kBatch> lit;
    for (int left = count; left > 0;) {
      const int first = sum.rays();
      const auto number = std::min(static_cast<std::size_t>(left), kBatch);
      for (std::size_t i = 0; i < number; ++i) {
        const int k = first + static_cast<int>(i);
        const auto lens = LensPoint(k, jitter);
        rays[i] = camera_.Through(static_cast<float>(column) + lens[0], static_cast<float>(row) + lens[1], kFar);
        rays[i].time = quality_.shutter > 0 ? ShutterTime(k, jitter) : 0;
      }
      light.Look(std::span(rays).first(number), std::span(hits).first(number));
      std::size_t lit_count = 0;
      for (std::size_t i = 0; i < number; ++i) {
        const int k = first + static_cast<int>(i);
        if (hits[i] && (k < shaded || faces.Find(*hits[i], scene_.IdOf(*hits[i])) < 0)) {
          lit[lit_count++] = {.ray = rays[i], .hit = *hits[i], .sample = k};
        }
      }
      light.Shade(std::span(lit).first(lit_count), jitter);
      std::size_t next = 0;
      for (const Lit& one : std::span(lit).first(lit_count)) faces.Add(one.hit, scene_.IdOf(one.hit), one.colour);
      for (std::size_t i = 0; i < number; ++i) {
        if (!hits[i]) {
          sum.AddOpen();
          continue;
        }
        const std::int32_t id = scene_.IdOf(*hits[i]);
        const bool own = next < lit_count && lit[next].sample == first + static_cast<int>(i);
        const Vec3f colour = own ? lit[next++].colour : faces.Colour(faces.Find(*hits[i], id));
        sum.Add(colour, *hits[i], id, hits[i]->distance * rays[i].direction.dot(camera_.forward));
      }
      left -= static_cast<int>(number);
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
  GroundShadow shadow_;
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
  ASSIGN_OR_RETURN(const FilmScene scene, FilmScene::Build(subject));
  const Lights lights = {StudioLight(scene.rays(), camera, studio, {.samples = quality.samples, .sky = 3, .key = 1}),
                         StudioLight(scene.rays(), camera, studio, {.samples = RefinedSamples(quality), .sky = 1, .key = 1})};
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
