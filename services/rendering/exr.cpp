// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/exr.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <exception>
#include <map>

#include <fmt/format.h>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <half.h>

#include "services/rendering/cryptomatte.h"

namespace vorocast::rendering {
namespace {

using geometry::Vec3f;

constexpr std::size_t kLevels = 3;  // of Cryptomatte: two ranks each
constexpr std::size_t kRanks = 2 * kLevels;
constexpr double kPixelsMax = 2e8;
constexpr int kZipLevel = 1;  // a third of the default level's time for files a fifth larger

/// One part of the file: channels that stand in memory one after another, each a plane of its own.
class Part {
 public:
  Part(const std::string& name, std::int32_t width, std::int32_t height)
      : header_(width, height), width_(width), pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
    header_.setName(name);
    header_.setType(Imf::SCANLINEIMAGE);
    header_.compression() = Imf::ZIP_COMPRESSION;
    header_.zipCompressionLevel() = kZipLevel;
  }
  Imf::Header& header() { return header_; }

  /// `value(i)` is pixel i's.
  template <typename Value>
  void Half(const std::string& channel, Value value) {
    Add<half>(channel, Imf::HALF, [&](std::size_t i) { return half(value(i)); });
  }
  template <typename Value>
  void Float(const std::string& channel, Value value) {
    Add<float>(channel, Imf::FLOAT, value);
  }
  template <typename Value>
  void Uint(const std::string& channel, Value value) {
    Add<std::uint32_t>(channel, Imf::UINT, value);
  }

  void Write(Imf::MultiPartOutputFile& file, int number) const {
    Imf::FrameBuffer buffer;
    for (const Plane& plane : planes_) {
      const std::size_t size = plane.bytes.size() / pixels_;
      // OpenEXR's interface takes a pointer to bytes that it does not change.
      char* base = const_cast<char*>(plane.bytes.data());
      buffer.insert(plane.channel, Imf::Slice(plane.type, base, size, size * static_cast<std::size_t>(width_)));
    }
    Imf::OutputPart part(file, number);
    part.setFrameBuffer(buffer);
    part.writePixels(header_.dataWindow().max.y + 1);
  }

 private:
  struct Plane {
    std::string channel;
    Imf::PixelType type;
    std::vector<char> bytes;
  };

  template <typename Stored, typename Value>
  void Add(const std::string& channel, Imf::PixelType type, Value value) {
    Plane& plane = planes_.emplace_back(Plane{channel, type, std::vector<char>(pixels_ * sizeof(Stored))});
    for (std::size_t i = 0; i < pixels_; ++i) {
      const Stored stored = value(i);
      std::memcpy(plane.bytes.data() + i * sizeof(Stored), &stored, sizeof(Stored));
    }
    header_.channels().insert(channel, Imf::Channel(type));
  }

  Imf::Header header_;
  std::int32_t width_;
  std::size_t pixels_;
  std::vector<Plane> planes_;
};

template <typename Vectors>
void AddVector(Part& part, const std::string& layer, const char* axes, const Vectors& vectors) {
  for (int axis = 0; axis < 3; ++axis) part.Half(layer + "." + axes[axis], [&](std::size_t i) { return vectors[i][axis]; });
}

/// `rank(i, r)`: id and coverage of the r-th largest thing in pixel i, (0, 0) where there is none.
template <typename Rank>
void AddCryptomatte(Part& part, const std::string& layer, const std::vector<std::string>& names, Rank rank) {
  const CryptomatteMetadata metadata = MakeMetadata(layer, names);
  part.header().insert(metadata.prefix + "name", Imf::StringAttribute(metadata.name));
  part.header().insert(metadata.prefix + "hash", Imf::StringAttribute("MurmurHash3_32"));
  part.header().insert(metadata.prefix + "conversion", Imf::StringAttribute("uint32_to_float32"));
  part.header().insert(metadata.prefix + "manifest", Imf::StringAttribute(metadata.manifest));
  for (std::size_t level = 0; level < kLevels; ++level) {
    const std::string prefix = fmt::format("{}{:02}.", layer, level);
    part.Float(prefix + "R", [&](std::size_t i) { return rank(i, 2 * level).first; });
    part.Float(prefix + "G", [&](std::size_t i) { return rank(i, 2 * level).second; });
    part.Float(prefix + "B", [&](std::size_t i) { return rank(i, 2 * level + 1).first; });
    part.Float(prefix + "A", [&](std::size_t i) { return rank(i, 2 * level + 1).second; });
  }
}

std::string ObjectName(const FilmMetadata& metadata, std::int32_t id) {
  const auto number = static_cast<std::size_t>(kObjectId - id);
  return number < metadata.object_names.size() ? metadata.object_names[number] : fmt::format("object_{}", number);
}

/// Hashes of the names of ids, each worked out once.
class Names {
 public:
  explicit Names(std::vector<std::string> names) : names_(std::move(names)) {
    for (const std::string& name : names_) ids_.push_back(CryptomatteId(name));
  }
  const std::vector<std::string>& all() const { return names_; }
  float Id(std::size_t index) const { return ids_[index]; }

 private:
  std::vector<std::string> names_;
  std::vector<float> ids_;
};

using PixelCoverage = std::array<FilmPicture::Coverage, kRanks>;

/// What the cells of each patch cover together, sorted as a picture's coverage is.
std::vector<PixelCoverage> CoverageByPatch(const FilmPicture& picture, const std::vector<std::int32_t>& patch) {
  std::vector<PixelCoverage> by_patch(picture.coverage.size());
  for (std::size_t i = 0; i < by_patch.size(); ++i) {
    std::size_t used = 0;
    for (const FilmPicture::Coverage& covered : picture.coverage[i]) {
      if (covered.part == 0 || covered.id < 0) continue;
      const std::int32_t p = patch[static_cast<std::size_t>(covered.id)];
      std::size_t at = 0;
      while (at < used && by_patch[i][at].id != p) ++at;
      if (at == used) by_patch[i][used++] = {p, 0};
      by_patch[i][at].part += covered.part;
    }
    std::stable_sort(by_patch[i].begin(), by_patch[i].begin() + static_cast<std::ptrdiff_t>(used),
                     [](const FilmPicture::Coverage& a, const FilmPicture::Coverage& b) { return a.part > b.part; });
  }
  return by_patch;
}

std::vector<std::string> Numbered(const char* prefix, std::size_t count) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i) names.push_back(fmt::format("{}_{:05}", prefix, i));
  return names;
}

/// Row vectors on the left, as the OpenEXR specification has it; x right, y up, the camera looks along −z.
Imath::M44f WorldToCamera(const Camera& camera) {
  Imath::M44f matrix;
  const Vec3f axes[] = {camera.right, camera.up, -camera.forward};
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) matrix[row][column] = axes[column][row];
    matrix[3][column] = -axes[column].dot(camera.eye);
  }
  return matrix;
}

std::vector<Part> MakeParts(const FilmPicture& picture, const Camera& camera, const std::vector<std::int32_t>& patch, const FilmMetadata& metadata) {
  std::vector<Part> parts;
  const auto part = [&](const char* name) -> Part& { return parts.emplace_back(name, picture.width, picture.height); };

  Part& rgba = part("rgba");
  for (std::size_t c = 0; c < 4; ++c) rgba.Half(std::string(1, "RGBA"[c]), [&](std::size_t i) { return picture.rgba[i][c]; });
  Imf::addComments(rgba.header(), "Vorocast");
  Imf::addFramesPerSecond(rgba.header(), Imf::Rational(metadata.frames_per_second));
  Imf::addWorldToCamera(rgba.header(), WorldToCamera(camera));
  rgba.header().insert("vorocast/seconds", Imf::FloatAttribute(static_cast<float>(metadata.seconds)));
  for (const auto& [name, value] : metadata.comments) rgba.header().insert(name, Imf::StringAttribute(value));

  part("depth").Float("Z", [&](std::size_t i) { return picture.depth[i]; });

  Part& utility = part("utility");
  AddVector(utility, "N", "XYZ", picture.normal);
  AddVector(utility, "velocity", "XYZ", picture.velocity);
  AddVector(utility, "shadow", "RGB", picture.shadow);
  utility.Half("forward.u", [&](std::size_t i) { return picture.forward[i][0]; });
  utility.Half("forward.v", [&](std::size_t i) { return picture.forward[i][1]; });

  Part& id = part("id");
  id.Uint("cell", [&](std::size_t i) { return static_cast<std::uint32_t>(std::max(picture.cell[i], -1) + 1); });
  id.Uint("patch", [&](std::size_t i) { return static_cast<std::uint32_t>(picture.patch[i] + 1); });

  std::vector<std::string> cells = Numbered("cell", patch.size());
  std::int32_t lowest = kObjectId + 1;
  for (const auto& pixel : picture.coverage) {
    for (const FilmPicture::Coverage& covered : pixel) lowest = std::min(lowest, covered.part > 0 ? covered.id : lowest);
  }
  const auto objects = std::max(metadata.object_names.size(), static_cast<std::size_t>(kObjectId + 1 - lowest));
  for (std::size_t o = 0; o < objects; ++o) cells.push_back(ObjectName(metadata, kObjectId - static_cast<std::int32_t>(o)));
  const Names cell_names(std::move(cells));
  const Names patch_names(Numbered("patch", patch.empty() ? 0 : static_cast<std::size_t>(*std::ranges::max_element(patch)) + 1));
  Part& crypto = part("crypto");
  AddCryptomatte(crypto, "CryptoCell", cell_names.all(), [&](std::size_t i, std::size_t r) {
    const FilmPicture::Coverage& covered = picture.coverage[i][r];
    if (covered.part == 0) return std::pair(0.0F, 0.0F);
    // Scene objects are named after the cells.
    const std::size_t index =
        covered.id >= 0 ? static_cast<std::size_t>(covered.id) : patch.size() + static_cast<std::size_t>(kObjectId - covered.id);
    return std::pair(cell_names.Id(index), covered.part);
  });
  const std::vector<PixelCoverage> by_patch = CoverageByPatch(picture, patch);
  AddCryptomatte(crypto, "CryptoPatch", patch_names.all(), [&](std::size_t i, std::size_t r) {
    const FilmPicture::Coverage& covered = by_patch[i][r];
    return covered.part == 0 ? std::pair(0.0F, 0.0F) : std::pair(patch_names.Id(static_cast<std::size_t>(covered.id)), covered.part);
  });
  return parts;
}

}  // namespace

absl::Status WriteExr(const std::filesystem::path& path, const FilmPicture& picture, const Camera& camera, const std::vector<std::int32_t>& patch,
                      const FilmMetadata& metadata) {
  try {
    std::vector<Part> parts = MakeParts(picture, camera, patch, metadata);
    std::vector<Imf::Header> headers;
    for (Part& part : parts) headers.push_back(part.header());
    Imf::MultiPartOutputFile file(path.c_str(), headers.data(), static_cast<int>(headers.size()), /*overrideSharedAttributes=*/false,
                                  /*numThreads=*/0);
    for (std::size_t i = 0; i < parts.size(); ++i) parts[i].Write(file, static_cast<int>(i));
  } catch (const std::exception& error) {
    return absl::UnavailableError(fmt::format("{}: cannot be written: {}", path.string(), error.what()));
  }
  return absl::OkStatus();
}

absl::StatusOr<FilmPicture> ReadExrBeauty(const std::filesystem::path& path) {
  try {
    Imf::MultiPartInputFile file(path.c_str(), /*numThreads=*/0);
    FilmPicture picture;
    for (int number = 0; number < file.parts(); ++number) {
      const Imf::Header& header = file.header(number);
      const std::string name = header.hasName() ? header.name() : "";
      if (name != "rgba" && name != "utility") continue;
      const Imath::Box2i window = header.dataWindow();
      const double width = static_cast<double>(window.max.x) - window.min.x + 1;
      const double height = static_cast<double>(window.max.y) - window.min.y + 1;
      if (window.min.x != 0 || window.min.y != 0 || !(width * height <= kPixelsMax)) {
        return absl::InvalidArgumentError(fmt::format("{}: a picture of {} × {} pixels is none that Vorocast writes", path.string(), width, height));
      }
      picture.width = static_cast<std::int32_t>(width);
      picture.height = static_cast<std::int32_t>(height);
      const std::size_t pixels = static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height);
      Imf::FrameBuffer buffer;
      // Missing channels are filled with nothing covered and nothing shadowed.
      if (name == "rgba") {
        picture.rgba.resize(pixels);
        for (std::size_t c = 0; c < 4; ++c) {
          buffer.insert(std::string(1, "RGBA"[c]),
                        Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(&picture.rgba[0][c]), 16, 16 * static_cast<std::size_t>(picture.width)));
        }
      } else {
        picture.shadow.resize(pixels);
        for (int c = 0; c < 3; ++c) {
          buffer.insert(std::string("shadow.") + "RGB"[c], Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(&picture.shadow[0][c]), sizeof(Vec3f),
                                                                      sizeof(Vec3f) * static_cast<std::size_t>(picture.width), 1, 1, 1.0));
        }
      }
      Imf::InputPart part(file, number);
      part.setFrameBuffer(buffer);
      part.readPixels(window.min.y, window.max.y);
    }
    if (picture.rgba.empty() || picture.rgba.size() != picture.shadow.size()) {
      return absl::InvalidArgumentError(
          fmt::format("{}: has not the parts rgba and utility of one size; was it made by this version?", path.string()));
    }
    return picture;
  } catch (const std::exception& error) {
    return absl::InvalidArgumentError(fmt::format("{}: is no readable OpenEXR file: {}", path.string(), error.what()));
  }
}

}  // namespace vorocast::rendering
