// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <optional>

#include "services/capture/frame_parser.h"
#include "services/capture/ply_header.h"
#include "services/capture/polygons.h"
#include "services/capture/text_lines.h"

namespace vorocast::capture {
namespace {

using geometry::Rgb8;
using geometry::Vec3;

/// Values of an element, one after another, from a body in either encoding. Every read is checked against the bytes that are left.
class PlyBody {
 public:
  PlyBody(std::string_view bytes, PlyEncoding encoding) : bytes_(bytes), encoding_(encoding), lines_(bytes, '\0') {}

  absl::Status BeginElement() {
    if (encoding_ != PlyEncoding::kAscii) return absl::OkStatus();
    ASSIGN_OR_RETURN(const bool more, lines_.Next(line_));
    return more ? absl::OkStatus() : absl::InvalidArgumentError("the file ends before it: it is truncated or its counts are wrong");
  }

  absl::Status EndElement() {
    if (encoding_ != PlyEncoding::kAscii || TakeWord(line_).empty()) return absl::OkStatus();
    return absl::InvalidArgumentError(fmt::format("line {} of the body holds more values than the header declares", lines_.line_number()));
  }

  absl::StatusOr<double> Value(PlyType type) {
    if (encoding_ == PlyEncoding::kAscii) return TextValue();
    if (bytes_.size() - position_ < SizeOf(type)) return absl::InvalidArgumentError("the file ends inside it: it is truncated");
    const char* at = bytes_.data() + position_;
    position_ += SizeOf(type);
    return BinaryValue(type, at);
  }

  /// Refuses a length that the rest of the file cannot hold.
  absl::StatusOr<std::int64_t> ListLength(const PlyProperty& list) {
    ASSIGN_OR_RETURN(const double length, Value(list.count_type));
    const bool ascii = encoding_ == PlyEncoding::kAscii;
    const std::size_t left = ascii ? line_.size() : bytes_.size() - position_;
    if (!(length >= 0 && length * static_cast<double>(ascii ? 2 : SizeOf(list.type)) <= static_cast<double>(left))) {
      return absl::InvalidArgumentError(
          fmt::format("its list {} has the length {}, which the {} bytes left cannot hold: the file is damaged", list.name, length, left));
    }
    return static_cast<std::int64_t>(length);
  }

  /// Passes over `count` elements without lists; the header's check has made sure that a binary body holds them.
  absl::Status Skip(std::int64_t count, std::size_t bytes_each) {
    if (encoding_ != PlyEncoding::kAscii) {
      const std::size_t bytes = static_cast<std::size_t>(count) * bytes_each;
      if (bytes_.size() - position_ < bytes) return absl::InvalidArgumentError("the file ends inside it: it is truncated");
      position_ += bytes;
      return absl::OkStatus();
    }
    for (std::int64_t i = 0; bytes_each > 0 && i < count; ++i) RETURN_IF_ERROR(BeginElement());
    return absl::OkStatus();
  }

  /// What follows the last element; blanks and line ends count as nothing.
  std::size_t LeftOver() const {
    const std::string_view rest = bytes_.substr(encoding_ == PlyEncoding::kAscii ? lines_.Position() : position_);
    return rest.find_first_not_of(std::string_view(" \t\r\n\0", 5)) == std::string_view::npos ? 0 : rest.size();
  }

 private:
  absl::StatusOr<double> TextValue() {
    const std::string_view word = TakeWord(line_);
    double value = 0;
    if (word.empty()) {
      return absl::InvalidArgumentError(fmt::format("line {} of the body holds fewer values than the header declares", lines_.line_number()));
    }
    if (!ParseNumber(word, value)) {
      return absl::InvalidArgumentError(fmt::format("'{}' in line {} of the body is no number", word.substr(0, 40), lines_.line_number()));
    }
    return value;
  }

  template <typename T>
  double Load(const char* at) const {
    std::array<char, sizeof(T)> raw;
    std::memcpy(raw.data(), at, sizeof(T));
    const bool file_is_little = encoding_ == PlyEncoding::kLittleEndian;
    if (file_is_little != (std::endian::native == std::endian::little)) std::ranges::reverse(raw);
    return static_cast<double>(std::bit_cast<T>(raw));
  }

  double BinaryValue(PlyType type, const char* at) const {
    switch (type) {
      case PlyType::kInt8:
        return Load<std::int8_t>(at);
      case PlyType::kUint8:
        return Load<std::uint8_t>(at);
      case PlyType::kInt16:
        return Load<std::int16_t>(at);
      case PlyType::kUint16:
        return Load<std::uint16_t>(at);
      case PlyType::kInt32:
        return Load<std::int32_t>(at);
      case PlyType::kUint32:
        return Load<std::uint32_t>(at);
      case PlyType::kFloat32:
        return Load<float>(at);
      case PlyType::kFloat64:
        return Load<double>(at);
    }
    return 0;
  }

  std::string_view bytes_;
  PlyEncoding encoding_;
  std::size_t position_ = 0;  // binary
  TextLines lines_;           // ascii
  std::string_view line_;
};

/// Which number of a vertex a property is: 0–2 position, 3–5 normal, 6–8 colour; none for what is read and dropped.
struct VertexLayout {
  static constexpr std::array<std::string_view, 9> kNames = {"x", "y", "z", "nx", "ny", "nz", "red", "green", "blue"};
  std::vector<std::optional<std::size_t>> slot;  // a property each
  std::array<bool, 9> present = {};
  bool float_colours = false;  // 0 … 1 instead of 0 … 255

  bool Has(std::size_t first) const { return present[first] && present[first + 1] && present[first + 2]; }
};

absl::StatusOr<VertexLayout> LayOut(const PlyElement& element) {
  VertexLayout layout;
  for (const PlyProperty& property : element.properties) {
    std::string_view name = property.name;
    if (name.starts_with("diffuse_")) name.remove_prefix(8);
    const auto found = std::ranges::find(VertexLayout::kNames, name);
    const auto slot = static_cast<std::size_t>(found - VertexLayout::kNames.begin());
    if (property.is_list || found == VertexLayout::kNames.end() || layout.present[slot]) {
      layout.slot.emplace_back(std::nullopt);
      continue;
    }
    layout.present[slot] = true;
    layout.slot.emplace_back(slot);
    if (slot >= 6 && !IsInteger(property.type)) layout.float_colours = true;
  }
  if (!layout.Has(0)) return absl::InvalidArgumentError("element vertex has no x, y and z: it is no point cloud or mesh");
  return layout;
}

std::uint8_t ToByte(double colour, bool is_float) {
  const double scaled = is_float ? 255 * colour : colour;
  return scaled >= 0 ? static_cast<std::uint8_t>(std::min(scaled + 0.5, 255.0)) : 0;  // a NaN becomes 0
}

/// Reads and drops one property.
absl::Status SkipProperty(const PlyProperty& property, PlyBody& body) {
  std::int64_t length = 1;
  if (property.is_list) {
    ASSIGN_OR_RETURN(length, body.ListLength(property));
  }
  for (std::int64_t i = 0; i < length; ++i) RETURN_IF_ERROR(body.Value(property.type).status());
  return absl::OkStatus();
}

absl::Status ReadVertex(const PlyElement& element, const VertexLayout& layout, PlyBody& body, std::array<double, 9>& values) {
  RETURN_IF_ERROR(body.BeginElement());
  for (std::size_t p = 0; p < element.properties.size(); ++p) {
    if (!layout.slot[p]) {
      RETURN_IF_ERROR(SkipProperty(element.properties[p], body));
      continue;
    }
    ASSIGN_OR_RETURN(values[*layout.slot[p]], body.Value(element.properties[p].type));
  }
  return body.EndElement();
}

absl::Status ReadVertices(const PlyElement& element, PlyBody& body, RawFrame& frame) {
  ASSIGN_OR_RETURN(const VertexLayout layout, LayOut(element));
  if (element.count > std::numeric_limits<std::int32_t>::max()) return absl::InvalidArgumentError("more than 2^31 vertices in one frame");
  const auto count = static_cast<std::size_t>(element.count);
  frame.mesh.vertices.reserve(count);
  if (layout.Has(3)) frame.normals.reserve(count);
  if (layout.Has(6)) frame.mesh.colours.reserve(count);
  std::array<double, 9> v = {};
  for (std::size_t i = 0; i < count; ++i) {
    if (absl::Status status = ReadVertex(element, layout, body, v); !status.ok()) return base::Annotate(status, fmt::format("vertex {}", i));
    frame.mesh.vertices.emplace_back(v[0], v[1], v[2]);
    if (layout.Has(3)) frame.normals.emplace_back(v[3], v[4], v[5]);
    if (layout.Has(6)) {
      const bool is_float = layout.float_colours;
      frame.mesh.colours.push_back(Rgb8{ToByte(v[6], is_float), ToByte(v[7], is_float), ToByte(v[8], is_float)});
    }
  }
  return absl::OkStatus();
}

absl::Status ReadFace(const PlyElement& element, PlyBody& body, std::vector<std::int64_t>& polygon) {
  RETURN_IF_ERROR(body.BeginElement());
  for (const PlyProperty& property : element.properties) {
    if (!property.is_list || (property.name != "vertex_indices" && property.name != "vertex_index")) {
      RETURN_IF_ERROR(SkipProperty(property, body));
      continue;
    }
    ASSIGN_OR_RETURN(const std::int64_t length, body.ListLength(property));
    polygon.clear();
    for (std::int64_t i = 0; i < length; ++i) {
      ASSIGN_OR_RETURN(const double index, body.Value(property.type));
      // Out of the range of vertex indices, also NaN, becomes −1, which no frame has.
      polygon.push_back(index >= 0 && index <= std::numeric_limits<std::int32_t>::max() ? static_cast<std::int64_t>(index) : -1);
    }
  }
  return body.EndElement();
}

absl::Status ReadFaces(const PlyElement& element, PlyBody& body, RawFrame& frame, std::int64_t vertex_count) {
  std::vector<std::int64_t> polygon;
  for (std::int64_t i = 0; i < element.count; ++i) {
    polygon.clear();
    if (absl::Status status = ReadFace(element, body, polygon); !status.ok()) return base::Annotate(status, fmt::format("face {}", i));
    for (std::int64_t vertex : polygon) {
      if (vertex < 0 || vertex >= vertex_count) {
        return absl::InvalidArgumentError(
            fmt::format("face {}: a vertex index is not in 0 … {}: the file is damaged or mixes up its parts; export it again", i, vertex_count - 1));
      }
    }
    AppendFan(polygon, frame.mesh.triangles);
  }
  return absl::OkStatus();
}

absl::Status SkipElement(const PlyElement& element, PlyEncoding encoding, PlyBody& body) {
  if (std::ranges::none_of(element.properties, &PlyProperty::is_list)) return body.Skip(element.count, element.MinimalBytes(encoding));
  for (std::int64_t i = 0; i < element.count; ++i) {
    RETURN_IF_ERROR(body.BeginElement());
    for (const PlyProperty& property : element.properties) RETURN_IF_ERROR(SkipProperty(property, body));
    RETURN_IF_ERROR(body.EndElement());
  }
  return absl::OkStatus();
}

absl::Status CheckElements(const PlyHeader& header) {
  std::int64_t vertex_elements = 0;
  for (const PlyElement& element : header.elements) {
    if (element.name == "vertex") ++vertex_elements;
    if (element.name == "tristrips" && element.count > 0) {
      return absl::InvalidArgumentError("holds triangle strips, which are not read: export it with plain faces");
    }
    // Without a property an element takes no bytes, so that no count of it could be held against the file.
    if (element.properties.empty() && element.count > 0 && (element.name == "vertex" || element.name == "face")) {
      return absl::InvalidArgumentError(fmt::format("element {} has no properties: the header is damaged", element.name));
    }
  }
  if (vertex_elements != 1) return absl::InvalidArgumentError(fmt::format("has {} elements named vertex instead of one", vertex_elements));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<RawFrame> ParsePly(std::string_view bytes) {
  ASSIGN_OR_RETURN(const PlyHeader header, ParsePlyHeader(bytes));
  RETURN_IF_ERROR(CheckElements(header));
  PlyBody body(bytes.substr(header.body), header.encoding);
  const std::int64_t vertex_count = std::ranges::find(header.elements, "vertex", &PlyElement::name)->count;
  RawFrame frame;
  for (const PlyElement& element : header.elements) {
    if (element.name == "vertex") {
      RETURN_IF_ERROR(ReadVertices(element, body, frame));
    } else if (element.name == "face") {
      RETURN_IF_ERROR(ReadFaces(element, body, frame, vertex_count));
    } else if (!element.properties.empty()) {
      if (absl::Status status = SkipElement(element, header.encoding, body); !status.ok()) return base::Annotate(status, "element " + element.name);
    }
  }
  if (const std::size_t left = body.LeftOver(); left > 0) {
    return absl::InvalidArgumentError(
        fmt::format("{} bytes follow the last element: the header's counts are wrong, or two files were joined; export it again", left));
  }
  return frame;
}

}  // namespace vorocast::capture
