// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/film_camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace vorocast::rendering {
namespace {

using geometry::Vec3;
using geometry::Vec3f;

constexpr double kElevationDegrees = 8;
constexpr double kFarthest = 1e5;  // metres: no coordinate of a stage is larger
constexpr std::size_t kKeysMax = 10000;

absl::StatusOr<Vec3> Point(const nlohmann::json& json, const std::string& field) {
  const auto found = json.find(field);
  if (found == json.end() || !found->is_array() || found->size() != 3) {
    return absl::InvalidArgumentError(fmt::format("camera: {}: give three numbers in metres, such as [0, 1.5, 4]", field));
  }
  Vec3 point;
  for (std::size_t i = 0; i < 3; ++i) {
    const nlohmann::json& value = (*found)[i];
    if (!value.is_number() || !(std::abs(value.get<double>()) <= kFarthest)) {
      return absl::InvalidArgumentError(fmt::format("camera: {}: the {} number is none, or beyond {} m", field,
                                                    i == 0   ? "first"
                                                    : i == 1 ? "second"
                                                             : "third",
                                                    kFarthest));
    }
    point[static_cast<Eigen::Index>(i)] = value.get<double>();
  }
  return point;
}

absl::StatusOr<double> Number(const nlohmann::json& json, const std::string& field, double otherwise, double low, double high) {
  const auto found = json.find(field);
  if (found == json.end()) return otherwise;
  if (!found->is_number() || !(found->get<double>() >= low && found->get<double>() <= high)) {
    return absl::InvalidArgumentError(fmt::format("camera: {}: give a number from {} to {}", field, low, high));
  }
  return found->get<double>();
}

absl::StatusOr<CameraPath::Key> Key(const nlohmann::json& json) {
  if (!json.is_object())
    return absl::InvalidArgumentError(R"(camera: give an object such as {"eye_m": [0, 1.5, 4], "target_m": [0, 1, 0], "fov_deg": 30})");
  for (const auto& [field, value] : json.items()) {
    if (field != "time_s" && field != "eye_m" && field != "target_m" && field != "fov_deg") {
      return absl::InvalidArgumentError(fmt::format("camera: {}: unknown; there are eye_m, target_m, fov_deg, and time_s within keys", field));
    }
  }
  CameraPath::Key key;
  ASSIGN_OR_RETURN(key.time_s, Number(json, "time_s", 0, 0, 1e6));
  ASSIGN_OR_RETURN(key.eye, Point(json, "eye_m"));
  ASSIGN_OR_RETURN(key.target, Point(json, "target_m"));
  ASSIGN_OR_RETURN(key.fov_deg, Number(json, "fov_deg", key.fov_deg, 1, 150));
  const Vec3 look = key.target - key.eye;
  if (look.norm() < 1e-6) return absl::InvalidArgumentError("camera: target_m: is where the eye is; move one of them");
  if (look.cross(Vec3::UnitY()).norm() < 1e-3 * look.norm()) {
    return absl::InvalidArgumentError("camera: target_m: is straight above or below the eye, where up has no direction; move it a little aside");
  }
  return key;
}

CameraPath::Key KeyAt(const CameraPath& path, double seconds) {
  const auto after = std::ranges::upper_bound(path.keys, seconds, {}, &CameraPath::Key::time_s);
  if (after == path.keys.begin()) return path.keys.front();
  if (after == path.keys.end()) return path.keys.back();
  const CameraPath::Key& a = *(after - 1);
  const CameraPath::Key& b = *after;
  const double t = (seconds - a.time_s) / (b.time_s - a.time_s);
  return {seconds, (1 - t) * a.eye + t * b.eye, (1 - t) * a.target + t * b.target, (1 - t) * a.fov_deg + t * b.fov_deg};
}

}  // namespace

absl::StatusOr<CameraPath> CameraPathFromJson(const nlohmann::json& json) {
  CameraPath path;
  if (!json.is_object() || !json.contains("keys")) {
    ASSIGN_OR_RETURN(const CameraPath::Key only, Key(json));
    path.keys.push_back(only);
    return path;
  }
  const nlohmann::json& keys = json["keys"];
  if (json.size() != 1 || !keys.is_array() || keys.empty() || keys.size() > kKeysMax) {
    return absl::InvalidArgumentError(fmt::format("camera: keys: give 1 to {} keys, and nothing beside them", kKeysMax));
  }
  for (const nlohmann::json& one : keys) {
    ASSIGN_OR_RETURN(const CameraPath::Key key, Key(one));
    if (!path.keys.empty() && key.time_s <= path.keys.back().time_s) {
      return absl::InvalidArgumentError(
          fmt::format("camera: time_s: {} does not come after {}; order the keys by time", key.time_s, path.keys.back().time_s));
    }
    path.keys.push_back(key);
  }
  return path;
}

Camera CameraAt(const CameraPath& path, double seconds, std::int32_t width, std::int32_t height) {
  const CameraPath::Key key = KeyAt(path, seconds);
  Camera camera;
  camera.eye = key.eye.cast<float>();
  camera.forward = (key.target - key.eye).normalized().cast<float>();
  camera.right = camera.forward.cross(Vec3f::UnitY()).normalized();
  camera.up = camera.right.cross(camera.forward);
  camera.width = width;
  camera.height = height;
  camera.pixel = static_cast<float>(2 * std::tan(key.fov_deg * std::numbers::pi / 360) / height);
  camera.left = -camera.pixel * static_cast<float>(width) / 2;
  camera.top = camera.pixel * static_cast<float>(height) / 2;
  return camera;
}

Camera CameraForFilm(const Bounds& bounds, double azimuth_deg, std::int32_t width, std::int32_t height) {
  Camera camera = FrameBounds(bounds, {.azimuth_deg = azimuth_deg, .elevation_deg = kElevationDegrees, .width = width});
  // The window of the bounds keeps its middle; the picture's shape decides which of its sides is tight.
  const float window_width = camera.pixel * static_cast<float>(camera.width);
  const float window_height = camera.pixel * static_cast<float>(camera.height);
  const float middle_x = camera.left + window_width / 2;
  const float middle_y = camera.top - window_height / 2;
  camera.width = width;
  camera.height = height;
  camera.pixel = std::max(window_width / static_cast<float>(width), window_height / static_cast<float>(height));
  camera.left = middle_x - camera.pixel * static_cast<float>(width) / 2;
  camera.top = middle_y + camera.pixel * static_cast<float>(height) / 2;
  return camera;
}

}  // namespace vorocast::rendering
