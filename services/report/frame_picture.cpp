// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/report/frame_picture.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <fmt/format.h>

#include "services/capture/frame_reader.h"
#include "services/rendering/sheet.h"

namespace vorocast::report {
namespace {

namespace fs = std::filesystem;
using geometry::Vec3;

constexpr std::size_t kPointsMax = 120'000;
constexpr std::int32_t kWidth = 300;  // pixels
constexpr double kHeight = 1.8;       // metres that everything is scaled to: what is drawn has no known unit

/// A folder for the short time in which a frame is a file.
class TemporaryFolder {
 public:
  static absl::StatusOr<TemporaryFolder> Make() {
    std::string name = (fs::temp_directory_path() / "vorocast-report-XXXXXX").string();
    if (!::mkdtemp(name.data())) return absl::UnavailableError(fmt::format("{}: cannot be made", name));
    return TemporaryFolder(name);
  }
  TemporaryFolder(TemporaryFolder&& other) noexcept : path_(std::move(other.path_)) { other.path_.clear(); }
  TemporaryFolder& operator=(TemporaryFolder&&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  const fs::path& path() const { return path_; }

 private:
  explicit TemporaryFolder(fs::path path) : path_(std::move(path)) {}
  fs::path path_;
};

absl::StatusOr<std::string> ReadBytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  if (!file) return absl::UnavailableError(fmt::format("{}: cannot be read back", path.string()));
  return bytes;
}

/// Some of the frame's finite points, evenly taken, about their middle and as large as a person.
geometry::OrientedPoints Points(const capture::RawFrame& raw) {
  geometry::OrientedPoints points;
  const auto& positions = raw.mesh.vertices;
  const std::size_t step = positions.size() / kPointsMax + 1;
  const bool with_normals = raw.normals.size() == positions.size();
  const bool with_colours = raw.mesh.colours.size() == positions.size();
  std::vector<Vec3> normals;
  for (std::size_t i = 0; i < positions.size(); i += step) {
    const Vec3 position = positions[i];
    if (!position.allFinite() || position.norm() > 1e9) continue;
    points.positions.push_back(position);
    normals.push_back(with_normals && raw.normals[i].allFinite() ? raw.normals[i] : Vec3(Vec3::Zero()));
    if (with_colours) points.colours.push_back(raw.mesh.colours[i]);
  }
  if (points.positions.empty()) return points;
  // Without the outermost hundredth, which may have gone astray.
  Vec3 low, high;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Vec3& position : points.positions) values.push_back(position[axis]);
    std::sort(values.begin(), values.end());
    low[axis] = values[values.size() / 100];
    high[axis] = values[values.size() - 1 - values.size() / 100];
  }
  const Vec3 middle = 0.5 * (low + high);
  const double size = std::max((high - low).maxCoeff(), 1e-9);
  const bool z_up = (high - low).z() > (high - low).y();
  const auto upright = [&](const Vec3& v) { return z_up ? Vec3(v.x(), v.z(), -v.y()) : v; };
  geometry::OrientedPoints shown;
  for (std::size_t i = 0; i < points.positions.size(); ++i) {
    const Vec3 position = upright(points.positions[i] - middle) * (kHeight / size);
    if (position.norm() > 3 * kHeight) continue;
    Vec3 normal = upright(normals[i]);
    // One that is missing or has no length points away from the middle.
    if (normal.norm() < 1e-6) normal = position;
    if (normal.norm() < 1e-6) normal = Vec3::UnitY();
    shown.positions.push_back(position);
    shown.normals.push_back(normal.normalized());
    if (with_colours) shown.colours.push_back(points.colours[i]);
  }
  return shown;
}

}  // namespace

absl::StatusOr<std::string> DrawFrame(const std::string& bytes, const std::string& extension) {
  ASSIGN_OR_RETURN(const TemporaryFolder folder, TemporaryFolder::Make());
  // The readers' errors begin with the path: "frame" is all that they may say of it.
  const fs::path path = folder.path() / ("frame" + extension);
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (file.fail()) return absl::UnavailableError(fmt::format("{}: cannot be written; is the disk full?", path.string()));
  const auto raw = capture::ReadRawFrame(path);
  if (!raw.ok()) {
    std::string message(raw.status().message());
    if (const std::size_t at = message.find(folder.path().string() + "/"); at != std::string::npos) {
      message.erase(at, folder.path().string().size() + 1);
    }
    return absl::Status(raw.status().code(), message);
  }
  rendering::PointsPicture picture{.points = Points(*raw)};
  if (picture.points.positions.empty()) return absl::DataLossError("the frame has no point that could be drawn");
  ASSIGN_OR_RETURN(const rendering::Image image, rendering::RenderSheet({std::move(picture)}, {.picture_width = kWidth}, {}));
  const fs::path png = folder.path() / "frame.png";
  RETURN_IF_ERROR(rendering::WritePng(png, image));
  return ReadBytes(png);
}

}  // namespace vorocast::report
