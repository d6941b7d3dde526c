// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/synth/capture_folder.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

namespace vorocast::synth {
namespace {

static_assert(std::endian::native == std::endian::little, "PLY bytes are written as they lie in memory");

void AppendFloats(const geometry::Vec3& x, std::string& bytes) {
  const geometry::Vec3f single = x.cast<float>();
  char raw[3 * sizeof(float)];
  std::memcpy(raw, single.data(), sizeof(raw));
  bytes.append(raw, sizeof(raw));
}

absl::Status WriteBytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) return absl::UnavailableError(fmt::format("{}: cannot write {} bytes: {}", path.string(), bytes.size(), std::strerror(errno)));
  return absl::OkStatus();
}

}  // namespace

absl::Status PrepareFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return absl::InvalidArgumentError(fmt::format("{}: cannot create the folder: {}", folder.string(), error.message()));
  const bool empty = std::filesystem::is_empty(folder, error);
  if (error) return absl::InvalidArgumentError(fmt::format("{}: cannot be listed: {}", folder.string(), error.message()));
  if (!empty) return absl::AlreadyExistsError(fmt::format("{}: is not empty; name a new folder, or empty this one", folder.string()));
  return absl::OkStatus();
}

std::string FrameName(std::int32_t frame) { return fmt::format("frame_{:04d}.ply", frame); }

absl::Status WritePly(const std::filesystem::path& path, const geometry::OrientedPoints& points) {
  const bool coloured = !points.colours.empty();
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\n{}end_header\n",
      points.size(), coloured ? "property uchar red\nproperty uchar green\nproperty uchar blue\n" : "");
  for (std::size_t i = 0; i < points.size(); ++i) {
    AppendFloats(points.positions[i], bytes);
    AppendFloats(points.normals[i], bytes);
    if (!coloured) continue;
    for (std::uint8_t channel : points.colours[i]) bytes.push_back(static_cast<char>(channel));
  }
  return WriteBytes(path, bytes);
}

absl::Status WriteDescription(const std::filesystem::path& path, const CaptureDescription& description) {
  nlohmann::ordered_json json;
  json["name"] = description.name;
  json["frames_per_second"] = description.frames_per_second;
  json["unit"] = "m";
  json["up"] = "+y";
  if (description.components > 0) json["components"] = description.components;
  return WriteBytes(path, json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

}  // namespace vorocast::synth
