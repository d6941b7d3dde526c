// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/interchange/ply_sequence.h"

#include <bit>
#include <cstring>
#include <fstream>
#include <string>
#include <system_error>

#include <fmt/format.h>

#include "services/interchange/pieces.h"

namespace vorocast::interchange {
namespace {

using geometry::CellState;
using geometry::Vec3f;

static_assert(std::endian::native == std::endian::little, "PLY bytes are written as they lie in memory");

template <typename Value>
void Append(const Value& value, std::string& bytes) {
  char raw[sizeof(Value)];
  std::memcpy(raw, &value, sizeof(Value));
  bytes.append(raw, sizeof(Value));
}

/// Two recalled neighbours of full size move as one body; between any others a cut is open. Copies come apart, so theirs are all open.
bool IsVisible(const MovingCells& take, std::size_t instant, const Piece& piece, const CellShape::Face& face) {
  if (face.skin || piece.copy >= 0) return true;
  const auto holds = [&](std::int32_t cell) {
    const auto c = static_cast<std::size_t>(cell);
    return take.State(instant, c) == CellState::kRecalled && take.Size(instant, c) == 1;
  };
  return !holds(piece.cell) || !holds(face.neighbour);
}

/// What a face says of the thing that it belongs to.
struct FaceLabel {
  std::int32_t cell, patch;
  CellState state;
  std::int32_t copy, pair;
};

FaceLabel LabelOf(const MovingCells& take, const Piece& piece, std::size_t instant) {
  FaceLabel label{.cell = piece.cell, .patch = -1, .state = CellState::kReleased, .copy = piece.copy, .pair = piece.pair};
  if (piece.cell >= 0) label.patch = take.model.patch[static_cast<std::size_t>(piece.cell)];
  if (piece.copy < 0 && piece.pair < 0) label.state = take.State(instant, static_cast<std::size_t>(piece.cell));
  return label;
}

std::string Frame(const MovingCells& take, const std::vector<Piece>& pieces, const std::vector<CellShape>& shapes, std::size_t instant) {
  // Takes without copies and pairs have no properties that tell them.
  const bool has_copies = !take.copies.offset.empty();
  const bool has_pairs = !take.morph.vertex_offset.empty();
  std::string vertices, faces;
  std::int32_t vertex_count = 0;
  std::size_t face_count = 0;
  std::vector<std::int32_t> number;  // in the file, of a piece's vertices
  for (const Piece& piece : pieces) {
    const Placement placement = PlacementOf(take, piece, instant);
    if (placement.size == 0) continue;
    const CellShape& shape = shapes[piece.shape];
    const FaceLabel label = LabelOf(take, piece, instant);
    number.assign(shape.vertices.size(), -1);
    for (const CellShape::Face& face : shape.faces) {
      if (!IsVisible(take, instant, piece, face)) continue;
      ++face_count;
      Append(static_cast<std::uint32_t>(face.loop.size()), faces);
      for (const std::int32_t v : face.loop) {
        std::int32_t& at = number[static_cast<std::size_t>(v)];
        if (at < 0) {
          at = vertex_count++;
          Append(Vec3f(WorldVertex(shape, placement, static_cast<std::size_t>(v)).cast<float>()), vertices);
        }
        Append(at, faces);
      }
      Append(label.cell, faces);
      Append(label.patch, faces);
      Append(static_cast<std::uint8_t>(face.skin), faces);
      Append(static_cast<std::uint8_t>(label.state), faces);
      if (has_copies) Append(label.copy, faces);
      if (has_pairs) Append(label.pair, faces);
    }
  }
  return fmt::format(
             "ply\nformat binary_little_endian 1.0\ncomment Vorocast, {:.6f} s, metres, y up\nelement vertex {}\nproperty float x\nproperty float y\n"
             "property float z\nelement face {}\nproperty list uint int vertex_indices\nproperty int cell\nproperty int patch\nproperty uchar skin\n"
             "property uchar state\n{}{}end_header\n",
             take.time[instant], vertex_count, face_count, has_copies ? "property int copy\n" : "", has_pairs ? "property int pair\n" : "") +
         vertices + faces;
}

}  // namespace

absl::Status WritePlySequence(const MovingCells& take, const std::filesystem::path& folder, const base::Progress& progress) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return absl::UnavailableError(fmt::format("{}: cannot create the folder: {}", folder.string(), error.message()));
  const std::vector<Piece> pieces = PiecesOf(take);
  const std::vector<CellShape> shapes = ShapesOf(take);
  for (std::size_t s = 0; s < take.instant_count(); ++s) {
    const std::filesystem::path path = folder / fmt::format("cells_{:06}.ply", s);
    const std::string bytes = Frame(take, pieces, shapes, s);
    std::ofstream file(path, std::ios::binary | std::ios::trunc);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    file.close();
    if (!file) return absl::UnavailableError(fmt::format("{}: cannot write {} bytes: {}", path.string(), bytes.size(), std::strerror(errno)));
    base::Report(progress, static_cast<double>(s + 1) / static_cast<double>(take.instant_count()));
  }
  return absl::OkStatus();
}

}  // namespace vorocast::interchange
