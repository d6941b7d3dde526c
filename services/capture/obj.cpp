// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "services/capture/frame_parser.h"
#include "services/capture/polygons.h"
#include "services/capture/text_lines.h"

namespace vorocast::capture {
namespace {

using geometry::Rgb8;
using geometry::Vec3;

/// One corner of a face, 0-based; −1 where it names no normal.
struct Corner {
  std::int64_t vertex = -1;
  std::int64_t normal = -1;
};

/// What is gathered while lines go by. Normals belong to corners in OBJ: a vertex gets the sum of those its corners name.
struct ObjContent {
  RawFrame frame;
  std::vector<Vec3> normals;       // vn lines
  std::vector<Vec3> corner_sum;    // a vertex each, as soon as a face names a normal
  std::vector<std::int64_t> loop;  // scratch: a face's vertices
};

absl::StatusOr<int> ReadNumbers(std::string_view line, std::array<double, 7>& values) {
  int count = 0;
  for (std::string_view word = TakeWord(line); !word.empty(); word = TakeWord(line)) {
    if (count == static_cast<int>(values.size())) return absl::InvalidArgumentError("holds more than 7 numbers");
    if (!ParseNumber(word, values[static_cast<std::size_t>(count)])) {
      return absl::InvalidArgumentError(fmt::format("'{}' is no number", word.substr(0, 40)));
    }
    ++count;
  }
  return count;
}

std::uint8_t ToByte(double colour) { return colour >= 0 ? static_cast<std::uint8_t>(std::min(255 * colour + 0.5, 255.0)) : 0; }

/// v x y z [w] or, as many exporters write it, v x y z r g b with colours in 0 … 1.
absl::Status ReadVertex(std::string_view line, ObjContent& content) {
  std::array<double, 7> v = {};
  ASSIGN_OR_RETURN(const int count, ReadNumbers(line, v));
  if (count != 3 && count != 4 && count != 6 && count != 7) {
    return absl::InvalidArgumentError(fmt::format("a vertex has {} numbers instead of 3, or 6 with a colour", count));
  }
  geometry::TriangleMesh& mesh = content.frame.mesh;
  const bool has_colour = count >= 6;
  if (!mesh.vertices.empty() && has_colour != !mesh.colours.empty()) {
    return absl::InvalidArgumentError("some vertices have a colour and some have none: export it again");
  }
  mesh.vertices.emplace_back(v[0], v[1], v[2]);
  if (has_colour) mesh.colours.push_back(Rgb8{ToByte(v[3]), ToByte(v[4]), ToByte(v[5])});
  return absl::OkStatus();
}

absl::Status ReadNormal(std::string_view line, ObjContent& content) {
  std::array<double, 7> v = {};
  ASSIGN_OR_RETURN(const int count, ReadNumbers(line, v));
  if (count != 3) return absl::InvalidArgumentError(fmt::format("a normal has {} numbers instead of 3", count));
  content.normals.emplace_back(v[0], v[1], v[2]);
  return absl::OkStatus();
}

/// From 1, or from −1 backwards over what has been read so far.
absl::StatusOr<std::int64_t> ResolveIndex(std::string_view word, std::size_t count) {
  std::int64_t index = 0;
  const auto n = static_cast<std::int64_t>(count);
  if (!ParseInteger(word, index)) return absl::InvalidArgumentError(fmt::format("'{}' is no index", word.substr(0, 40)));
  if (index == 0 || index > n || index < -n) {
    return absl::InvalidArgumentError(fmt::format("the index {} does not fit the {} read before it: the file is damaged or truncated", index, n));
  }
  return index > 0 ? index - 1 : n + index;
}

/// v, v/vt, v//vn or v/vt/vn.
absl::StatusOr<Corner> ReadCorner(std::string_view word, const ObjContent& content) {
  Corner corner;
  const std::size_t first = word.find('/');
  ASSIGN_OR_RETURN(corner.vertex, ResolveIndex(word.substr(0, first), content.frame.mesh.vertices.size()));
  if (first == std::string_view::npos) return corner;
  const std::size_t second = word.find('/', first + 1);
  if (second == std::string_view::npos) return corner;
  ASSIGN_OR_RETURN(corner.normal, ResolveIndex(word.substr(second + 1), content.normals.size()));
  return corner;
}

absl::Status ReadFace(std::string_view line, ObjContent& content) {
  content.loop.clear();
  for (std::string_view word = TakeWord(line); !word.empty(); word = TakeWord(line)) {
    ASSIGN_OR_RETURN(const Corner corner, ReadCorner(word, content));
    content.loop.push_back(corner.vertex);
    if (corner.normal < 0) continue;
    content.corner_sum.resize(content.frame.mesh.vertices.size(), Vec3::Zero());
    content.corner_sum[static_cast<std::size_t>(corner.vertex)] += content.normals[static_cast<std::size_t>(corner.normal)];
  }
  if (content.loop.size() < 3) return absl::InvalidArgumentError(fmt::format("a face has {} corners instead of 3 or more", content.loop.size()));
  AppendFan(content.loop, content.frame.mesh.triangles);
  return absl::OkStatus();
}

absl::Status ReadLine(std::string_view line, ObjContent& content) {
  // A backslash at the end joins lines; no exporter of captures writes it.
  if (line.ends_with('\\')) return absl::InvalidArgumentError("is continued with a backslash, which is not read: export it again");
  const std::string_view keyword = TakeWord(line);
  if (keyword == "v") return ReadVertex(line, content);
  if (keyword == "vn") return ReadNormal(line, content);
  if (keyword == "f") return ReadFace(line, content);
  // Texture coordinates, groups, materials, lines and points say nothing about the surface. A line of anything else is not OBJ.
  static constexpr std::array<std::string_view, 14> kIgnored = {"vt", "vp", "g",  "o",      "s",      "mtllib", "usemtl",
                                                                "l",  "p",  "mg", "maplib", "usemap", "lod",    "bevel"};
  if (std::ranges::find(kIgnored, keyword) != kIgnored.end()) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format("'{}' is no keyword of a polygonal OBJ file", keyword.substr(0, 40)));
}

/// Normals a vertex each: from the faces' corners, or, in a point cloud, in the vertices' order.
void AssignNormals(ObjContent& content) {
  const std::size_t count = content.frame.mesh.vertices.size();
  if (!content.corner_sum.empty()) {
    content.corner_sum.resize(count, Vec3::Zero());
    for (Vec3& n : content.corner_sum) {
      const double length = n.norm();
      if (length > 0) n /= length;
    }
    content.frame.normals = std::move(content.corner_sum);
  } else if (!content.frame.is_mesh() && content.normals.size() == count) {
    content.frame.normals = std::move(content.normals);
  }
}

}  // namespace

absl::StatusOr<RawFrame> ParseObj(std::string_view bytes) {
  TextLines lines(bytes, '#');
  ObjContent content;
  std::string_view line;
  while (true) {
    ASSIGN_OR_RETURN(const bool more, lines.Next(line));
    if (!more) break;
    if (absl::Status status = ReadLine(line, content); !status.ok()) return base::Annotate(status, fmt::format("line {}", lines.line_number()));
    if (content.frame.mesh.vertices.size() > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max())) {
      return absl::InvalidArgumentError("more than 2^31 vertices in one frame");
    }
  }
  AssignNormals(content);
  return std::move(content.frame);
}

}  // namespace vorocast::capture
