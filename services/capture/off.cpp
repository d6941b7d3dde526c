// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>

#include "services/capture/frame_parser.h"
#include "services/capture/polygons.h"
#include "services/capture/text_lines.h"

namespace vorocast::capture {
namespace {

using geometry::Rgb8;
using geometry::Vec3;

struct OffHeader {
  bool has_normals = false;
  bool has_colours = false;
  int texture_numbers = 0;
  std::int64_t vertices = 0;
  std::int64_t faces = 0;
};

/// [ST][C][N]OFF; the four-dimensional forms (4OFF, nOFF) are no surfaces in space.
absl::Status ParseKeyword(std::string_view keyword, OffHeader& header) {
  std::string_view rest = keyword;
  if (rest.starts_with("ST")) header.texture_numbers = 2, rest.remove_prefix(2);
  if (rest.starts_with("C")) header.has_colours = true, rest.remove_prefix(1);
  if (rest.starts_with("N")) header.has_normals = true, rest.remove_prefix(1);
  if (rest == "OFF") return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("starts with '{}' instead of OFF, COFF, NOFF or CNOFF: it is no OFF file, or it is damaged", keyword.substr(0, 40)));
}

absl::Status CheckCounts(const OffHeader& header, std::size_t present) {
  if (header.vertices < 0 || header.faces < 0 || header.vertices > std::numeric_limits<std::int32_t>::max()) {
    return absl::InvalidArgumentError(fmt::format("declares {} vertices and {} faces: the file is damaged", header.vertices, header.faces));
  }
  // A digit and a separator for each number; the last may end with the file. A face without corners takes two bytes.
  const auto left = static_cast<std::int64_t>(present) + 1;
  if (header.vertices <= left / 6 && header.faces <= (left - 6 * header.vertices) / 2) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format(
      "declares {} vertices and {} faces, but only {} bytes follow: the file is truncated or its counts are wrong; copy it again from the "
      "capture stage",
      header.vertices, header.faces, present));
}

absl::StatusOr<OffHeader> ParseHeader(TextLines& lines) {
  std::string_view line;
  ASSIGN_OR_RETURN(const bool has_first, lines.Next(line));
  if (!has_first) return absl::InvalidArgumentError("the file is empty");
  OffHeader header;
  RETURN_IF_ERROR(ParseKeyword(TakeWord(line), header));
  std::string_view word = TakeWord(line);
  if (word == "BINARY") return absl::InvalidArgumentError("is a binary OFF file, which is not read: export it as PLY");
  if (word.empty()) {
    ASSIGN_OR_RETURN(const bool has_counts, lines.Next(line));
    if (!has_counts) return absl::InvalidArgumentError("the file ends before its counts: it is truncated");
    word = TakeWord(line);
  }
  if (!ParseInteger(word, header.vertices) || !ParseInteger(TakeWord(line), header.faces)) {
    return absl::InvalidArgumentError(fmt::format("line {}: the counts of vertices and faces are no numbers", lines.line_number()));
  }
  RETURN_IF_ERROR(CheckCounts(header, lines.Remaining()));
  return header;
}

/// Whole numbers are 0 … 255, others 0 … 1: both are written.
Rgb8 ToColour(const std::array<double, 3>& c, bool whole) {
  Rgb8 colour;
  for (std::size_t i = 0; i < 3; ++i) {
    const double scaled = whole ? c[i] : 255 * c[i];
    colour[i] = scaled >= 0 ? static_cast<std::uint8_t>(std::min(scaled + 0.5, 255.0)) : 0;
  }
  return colour;
}

absl::StatusOr<double> TakeNumber(std::string_view& line) {
  const std::string_view word = TakeWord(line);
  double value = 0;
  if (word.empty()) return absl::InvalidArgumentError("holds too few numbers");
  if (!ParseNumber(word, value)) return absl::InvalidArgumentError(fmt::format("'{}' is no number", word.substr(0, 40)));
  return value;
}

absl::StatusOr<Vec3> TakeVector(std::string_view& line) {
  Vec3 v;
  for (int i = 0; i < 3; ++i) {
    ASSIGN_OR_RETURN(v[i], TakeNumber(line));
  }
  return v;
}

absl::Status ReadVertex(std::string_view line, const OffHeader& header, RawFrame& frame) {
  ASSIGN_OR_RETURN(const Vec3 position, TakeVector(line));
  frame.mesh.vertices.push_back(position);
  if (header.has_normals) {
    ASSIGN_OR_RETURN(const Vec3 normal, TakeVector(line));
    frame.normals.push_back(normal);
  }
  if (header.has_colours) {
    std::string_view peek = line;
    bool whole = true;
    for (int i = 0; i < 3; ++i) whole = whole && TakeWord(peek).find_first_of(".eEn") == std::string_view::npos;
    ASSIGN_OR_RETURN(const Vec3 colour, TakeVector(line));
    frame.mesh.colours.push_back(ToColour({colour.x(), colour.y(), colour.z()}, whole));
    return absl::OkStatus();  // opacity and texture coordinates may follow
  }
  for (int i = 0; i < header.texture_numbers; ++i) RETURN_IF_ERROR(TakeNumber(line).status());
  if (TakeWord(line).empty()) return absl::OkStatus();
  return absl::InvalidArgumentError("holds more numbers than its header says: a file with colours starts with COFF, one with normals with NOFF");
}

absl::Status ReadFace(std::string_view line, std::int64_t vertex_count, std::vector<std::int64_t>& polygon) {
  std::int64_t length = 0;
  if (!ParseInteger(TakeWord(line), length) || length < 0 || static_cast<std::size_t>(length) > line.size() / 2) {
    return absl::InvalidArgumentError("the number of corners is no number or more than the line holds");
  }
  polygon.clear();
  for (std::int64_t i = 0; i < length; ++i) {
    std::int64_t index = 0;
    if (!ParseInteger(TakeWord(line), index) || index < 0 || index >= vertex_count) {
      return absl::InvalidArgumentError(fmt::format("a vertex index is not in 0 … {}: the file is damaged", vertex_count - 1));
    }
    polygon.push_back(index);
  }
  return absl::OkStatus();  // what follows is the face's colour
}

}  // namespace

absl::StatusOr<RawFrame> ParseOff(std::string_view bytes) {
  TextLines lines(bytes, '#');
  ASSIGN_OR_RETURN(const OffHeader header, ParseHeader(lines));
  RawFrame frame;
  frame.mesh.vertices.reserve(static_cast<std::size_t>(header.vertices));
  std::vector<std::int64_t> polygon;
  std::string_view line;
  for (std::int64_t i = 0; i < header.vertices + header.faces; ++i) {
    const bool is_vertex = i < header.vertices;
    ASSIGN_OR_RETURN(const bool more, lines.Next(line));
    if (!more) {
      return absl::InvalidArgumentError(fmt::format("the file ends after {} of {} vertices and {} of {} faces: it is truncated",
                                                    std::min(i, header.vertices), header.vertices, is_vertex ? 0 : i - header.vertices,
                                                    header.faces));
    }
    const absl::Status status = is_vertex ? ReadVertex(line, header, frame) : ReadFace(line, header.vertices, polygon);
    if (!status.ok()) {
      return base::Annotate(status,
                            fmt::format("line {}, {} {}", lines.line_number(), is_vertex ? "vertex" : "face", is_vertex ? i : i - header.vertices));
    }
    if (!is_vertex) AppendFan(polygon, frame.mesh.triangles);
  }
  ASSIGN_OR_RETURN(const bool left_over, lines.Next(line));
  if (left_over) {
    return absl::InvalidArgumentError(
        fmt::format("line {} follows the last face: the counts in the header are wrong; export it again", lines.line_number()));
  }
  return frame;
}

}  // namespace vorocast::capture
