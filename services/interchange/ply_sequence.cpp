// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/interchange/ply_sequence.h"

#include <bit>
#include <cstring>
#include <fstream>
#include <string>
#include <system_error>

#include <fmt/format.h>

namespace vorocast::interchange {
namespace {

using geometry::CellState;
using geometry::Rigid3;
using geometry::Vec3f;

static_assert(std::endian::native == std::endian::little, "PLY bytes are written as they lie in memory");

template <typename Value>
void Append(const Value& value, std::string& bytes) {
  char raw[sizeof(Value)];
  std::memcpy(raw, &value, sizeof(Value));
  bytes.append(raw, sizeof(Value));
}

/// Two recalled neighbours move as one body; between any others a cut is open.
bool IsVisible(const MovingCells& take, std::size_t instant, std::size_t cell, const CellShape::Face& face) {
  if (face.skin) return true;
  return take.State(instant, cell) != CellState::kRecalled || take.State(instant, static_cast<std::size_t>(face.neighbour)) != CellState::kRecalled;
}

std::string Frame(const MovingCells& take, const std::vector<CellShape>& shapes, std::size_t instant) {
  std::string vertices, faces;
  std::int32_t vertex_count = 0;
  std::size_t face_count = 0;
  std::vector<std::int32_t> number;  // in the file, of a cell's vertices
  for (std::size_t cell = 0; cell < shapes.size(); ++cell) {
    const CellState state = take.State(instant, cell);
    if (state == CellState::kGone) continue;
    const CellShape& shape = shapes[cell];
    const Rigid3 world_from_shape = WorldFromShape(take, instant, cell);
    const double size = take.Size(instant, cell);
    number.assign(shape.vertices.size(), -1);
    for (const CellShape::Face& face : shape.faces) {
      if (!IsVisible(take, instant, cell, face)) continue;
      ++face_count;
      Append(static_cast<std::uint32_t>(face.loop.size()), faces);
      for (const std::int32_t v : face.loop) {
        std::int32_t& at = number[static_cast<std::size_t>(v)];
        if (at < 0) {
          at = vertex_count++;
          Append(Vec3f((world_from_shape * (size * shape.vertices[static_cast<std::size_t>(v)])).cast<float>()), vertices);
        }
        Append(at, faces);
      }
      Append(static_cast<std::int32_t>(cell), faces);
      Append(take.model.patch[cell], faces);
      Append(static_cast<std::uint8_t>(face.skin), faces);
      Append(static_cast<std::uint8_t>(state), faces);
    }
  }
  return fmt::format(
             "ply\nformat binary_little_endian 1.0\ncomment Vorocast, {:.6f} s, metres, y up\nelement vertex {}\nproperty float x\nproperty float y\n"
             "property float z\nelement face {}\nproperty list uint int vertex_indices\nproperty int cell\nproperty int patch\nproperty uchar skin\n"
             "property uchar state\nend_header\n",
             take.time[instant], vertex_count, face_count) +
         vertices + faces;
}

}  // namespace

absl::Status WritePlySequence(const MovingCells& take, const std::filesystem::path& folder, const base::Progress& progress) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return absl::UnavailableError(fmt::format("{}: cannot create the folder: {}", folder.string(), error.message()));
  std::vector<CellShape> shapes;
  for (std::size_t cell = 0; cell < take.cell_count(); ++cell) shapes.push_back(ShapeOfCell(take.model.cells, cell));
  for (std::size_t s = 0; s < take.instant_count(); ++s) {
    const std::filesystem::path path = folder / fmt::format("cells_{:06}.ply", s);
    const std::string bytes = Frame(take, shapes, s);
    std::ofstream file(path, std::ios::binary | std::ios::trunc);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    file.close();
    if (!file) return absl::UnavailableError(fmt::format("{}: cannot write {} bytes: {}", path.string(), bytes.size(), std::strerror(errno)));
    base::Report(progress, static_cast<double>(s + 1) / static_cast<double>(take.instant_count()));
  }
  return absl::OkStatus();
}

}  // namespace vorocast::interchange
