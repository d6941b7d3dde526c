// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/interchange/point_cache.h"

#include <bit>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <string>

#include <fmt/format.h>

#include "services/interchange/pieces.h"

namespace vorocast::interchange {
namespace {

using geometry::Vec3;

void Append(std::uint32_t bits, std::endian order, std::string& bytes) {
  for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<char>(bits >> (order == std::endian::little ? 8 * i : 24 - 8 * i)));
}
void Append(float value, std::endian order, std::string& bytes) { Append(std::bit_cast<std::uint32_t>(value), order, bytes); }

/// PC2 header: signature, version 1, points, first frame, sample rate in frames, samples.
std::string Pc2Head(const MovingCells& take, std::uint32_t vertices) {
  std::string head("POINTCACHE2\0", 12);
  const std::size_t instants = take.instant_count();
  const double span = (take.time.back() - take.time.front()) * take.frames_per_second;
  Append(std::uint32_t{1}, std::endian::little, head);
  Append(vertices, std::endian::little, head);
  Append(static_cast<float>(take.time.front() * take.frames_per_second), std::endian::little, head);
  Append(instants > 1 ? static_cast<float>(span / static_cast<double>(instants - 1)) : 1.0F, std::endian::little, head);
  Append(static_cast<std::uint32_t>(instants), std::endian::little, head);
  return head;
}

/// MDD header: samples, points, the time of each sample in seconds.
std::string MddHead(const MovingCells& take, std::uint32_t vertices) {
  std::string head;
  Append(static_cast<std::uint32_t>(take.instant_count()), std::endian::big, head);
  Append(vertices, std::endian::big, head);
  for (const double time : take.time) Append(static_cast<float>(time), std::endian::big, head);
  return head;
}

/// The mesh that the cache moves: the cells at the first instant, and what comes later where it comes, so that no face of it is without extent.
absl::Status WriteObj(const MovingCells& take, const std::vector<Piece>& pieces, const std::vector<CellShape>& shapes,
                      const std::filesystem::path& path) {
  std::ofstream file(path, std::ios::trunc);
  file << "# Vorocast: the cells at the first instant, copies and pairs where they come, metres, y up\n";
  std::int64_t first = 1;  // OBJ counts from one
  for (const Piece& piece : pieces) {
    const CellShape& shape = shapes[piece.shape];
    Placement placement = PlacementOf(take, piece, piece.first);
    placement.size = 1;
    std::string text = fmt::format("g {}\n", piece.Name());
    for (std::size_t v = 0; v < shape.vertices.size(); ++v) {
      const Vec3 x = WorldVertex(shape, placement, v);
      text += fmt::format("v {:.7g} {:.7g} {:.7g}\n", x.x(), x.y(), x.z());
    }
    for (const bool skin : {true, false}) {
      bool any = false;
      for (const CellShape::Face& face : shape.faces) {
        if (face.skin != skin) continue;
        if (!any) text += skin ? "usemtl skin\n" : "usemtl cut\n";
        any = true;
        text += "f";
        for (const std::int32_t v : face.loop) text += fmt::format(" {}", first + v);
        text += "\n";
      }
    }
    first += static_cast<std::int64_t>(shape.vertices.size());
    file << text;
  }
  file.close();
  if (!file) return absl::UnavailableError(fmt::format("{}: cannot be written; is the disk full?", path.string()));
  return absl::OkStatus();
}

}  // namespace

absl::Status WritePointCache(const MovingCells& take, PointCache format, const std::filesystem::path& path, const base::Progress& progress) {
  const std::vector<Piece> pieces = PiecesOf(take);
  const std::vector<CellShape> shapes = ShapesOf(take);
  std::size_t vertices = 0;
  for (const Piece& piece : pieces) vertices += shapes[piece.shape].vertices.size();
  if (vertices > std::numeric_limits<std::int32_t>::max() || take.instant_count() > std::numeric_limits<std::int32_t>::max()) {
    return absl::ResourceExhaustedError(
        fmt::format("{}: a point cache cannot count {} vertices at {} instants", path.string(), vertices, take.instant_count()));
  }
  RETURN_IF_ERROR(WriteObj(take, pieces, shapes, std::filesystem::path(path).replace_extension(".obj")));

  const std::endian order = format == PointCache::kPc2 ? std::endian::little : std::endian::big;
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  const auto count = static_cast<std::uint32_t>(vertices);
  file << (format == PointCache::kPc2 ? Pc2Head(take, count) : MddHead(take, count));
  for (std::size_t s = 0; s < take.instant_count(); ++s) {
    std::string bytes;
    for (const Piece& piece : pieces) {
      const CellShape& shape = shapes[piece.shape];
      const Placement placement = PlacementOf(take, piece, s);
      for (std::size_t v = 0; v < shape.vertices.size(); ++v) {
        const Vec3 x = WorldVertex(shape, placement, v);
        for (const double coordinate : {x.x(), x.y(), x.z()}) Append(static_cast<float>(coordinate), order, bytes);
      }
    }
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    base::Report(progress, static_cast<double>(s + 1) / static_cast<double>(take.instant_count()));
  }
  file.close();
  if (!file) return absl::UnavailableError(fmt::format("{}: cannot be written; is the disk full?", path.string()));
  return absl::OkStatus();
}

}  // namespace vorocast::interchange
