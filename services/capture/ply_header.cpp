// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/ply_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "services/capture/text_lines.h"

namespace vorocast::capture {
namespace {

constexpr std::size_t kHeaderMax = 1 << 20;
constexpr std::size_t kPropertiesMax = 1000;

std::optional<PlyType> TypeOf(std::string_view name) {
  static constexpr std::array<std::pair<std::string_view, PlyType>, 16> kTypes = {{{"char", PlyType::kInt8},
                                                                                   {"int8", PlyType::kInt8},
                                                                                   {"uchar", PlyType::kUint8},
                                                                                   {"uint8", PlyType::kUint8},
                                                                                   {"short", PlyType::kInt16},
                                                                                   {"int16", PlyType::kInt16},
                                                                                   {"ushort", PlyType::kUint16},
                                                                                   {"uint16", PlyType::kUint16},
                                                                                   {"int", PlyType::kInt32},
                                                                                   {"int32", PlyType::kInt32},
                                                                                   {"uint", PlyType::kUint32},
                                                                                   {"uint32", PlyType::kUint32},
                                                                                   {"float", PlyType::kFloat32},
                                                                                   {"float32", PlyType::kFloat32},
                                                                                   {"double", PlyType::kFloat64},
                                                                                   {"float64", PlyType::kFloat64}}};
  for (const auto& [known, type] : kTypes) {
    if (name == known) return type;
  }
  return std::nullopt;
}

absl::StatusOr<PlyEncoding> ParseFormat(std::string_view line) {
  const std::string_view encoding = TakeWord(line);
  if (const std::string_view version = TakeWord(line); version != "1.0") {
    return absl::InvalidArgumentError(fmt::format("PLY version '{}' is unknown, only 1.0 is read", version));
  }
  if (encoding == "ascii") return PlyEncoding::kAscii;
  if (encoding == "binary_little_endian") return PlyEncoding::kLittleEndian;
  if (encoding == "binary_big_endian") return PlyEncoding::kBigEndian;
  return absl::InvalidArgumentError(
      fmt::format("format '{}' is unknown: PLY has ascii, binary_little_endian and binary_big_endian", encoding.substr(0, 40)));
}

absl::StatusOr<PlyElement> ParseElement(std::string_view line) {
  PlyElement element;
  element.name = std::string(TakeWord(line));
  const std::string_view count = TakeWord(line);
  if (element.name.empty() || !ParseInteger(count, element.count) || element.count < 0) {
    return absl::InvalidArgumentError(fmt::format("'element {} {}' should be a name and a count", element.name.substr(0, 40), count.substr(0, 40)));
  }
  return element;
}

absl::StatusOr<PlyProperty> ParseProperty(std::string_view line) {
  PlyProperty property;
  std::string_view type = TakeWord(line);
  if (type == "list") {
    property.is_list = true;
    const std::string_view count = TakeWord(line);
    const auto count_type = TypeOf(count);
    if (!count_type || !IsInteger(*count_type)) {
      return absl::InvalidArgumentError(fmt::format("'{}' is no integer type for the length of a list", count.substr(0, 40)));
    }
    property.count_type = *count_type;
    type = TakeWord(line);
  }
  const auto value_type = TypeOf(type);
  property.name = std::string(TakeWord(line));
  if (!value_type) return absl::InvalidArgumentError(fmt::format("property '{}' has the unknown type '{}'", property.name, type.substr(0, 40)));
  if (property.name.empty()) return absl::InvalidArgumentError("a property has no name");
  property.type = *value_type;
  return property;
}

absl::Status ParseHeaderLine(std::string_view line, PlyHeader& header, bool& has_format) {
  const std::string_view keyword = TakeWord(line);
  if (keyword == "format") {
    has_format = true;
    ASSIGN_OR_RETURN(header.encoding, ParseFormat(line));
  } else if (keyword == "element") {
    ASSIGN_OR_RETURN(PlyElement element, ParseElement(line));
    header.elements.push_back(std::move(element));
  } else if (keyword == "property") {
    if (header.elements.empty()) return absl::InvalidArgumentError("a property stands before the first element");
    if (header.elements.back().properties.size() >= kPropertiesMax) {
      return absl::InvalidArgumentError(fmt::format("element {} has more than {} properties", header.elements.back().name, kPropertiesMax));
    }
    ASSIGN_OR_RETURN(PlyProperty property, ParseProperty(line));
    header.elements.back().properties.push_back(std::move(property));
  } else if (keyword != "comment" && keyword != "obj_info") {
    return absl::InvalidArgumentError(fmt::format("'{}' is no line of a PLY header", keyword.substr(0, 40)));
  }
  return absl::OkStatus();
}

absl::Status CheckCounts(const PlyHeader& header, std::size_t present) {
  const bool ascii = header.encoding == PlyEncoding::kAscii;
  std::uint64_t left = ascii ? present + 1 : present;  // the last value of a text may end with the file
  for (const PlyElement& element : header.elements) {
    const std::size_t each = element.MinimalBytes(header.encoding);
    if (each == 0) continue;  // an element without properties takes no bytes, whatever its count
    const auto count = static_cast<std::uint64_t>(element.count);
    if (count > left / each) {
      return absl::InvalidArgumentError(
          fmt::format("the header declares {} × {} of {}{} bytes, but {} bytes are left for them: the file is truncated or its counts are wrong; "
                      "copy it again from the capture stage",
                      count, element.name, ascii ? "at least " : "", each, left));
    }
    left -= count * each;
  }
  return absl::OkStatus();
}

}  // namespace

std::size_t SizeOf(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 2;
    case PlyType::kInt32:
    case PlyType::kUint32:
    case PlyType::kFloat32:
      return 4;
    case PlyType::kFloat64:
      return 8;
  }
  return 0;
}

bool IsInteger(PlyType type) { return type != PlyType::kFloat32 && type != PlyType::kFloat64; }

std::size_t PlyElement::MinimalBytes(PlyEncoding encoding) const {
  if (encoding == PlyEncoding::kAscii) return 2 * properties.size();  // a digit and what separates it from the next
  std::size_t bytes = 0;
  for (const PlyProperty& property : properties) bytes += SizeOf(property.is_list ? property.count_type : property.type);
  return bytes;
}

absl::StatusOr<PlyHeader> ParsePlyHeader(std::string_view bytes) {
  TextLines lines(bytes.substr(0, kHeaderMax), '\0');
  std::string_view line;
  ASSIGN_OR_RETURN(const bool has_first, lines.Next(line));
  if (!has_first || TakeWord(line) != "ply") return absl::InvalidArgumentError("does not start with 'ply': it is no PLY file, or it is damaged");
  PlyHeader header;
  bool has_format = false;
  while (true) {
    ASSIGN_OR_RETURN(const bool more, lines.Next(line));
    if (!more) return absl::InvalidArgumentError("the header has no 'end_header': the file is truncated; copy it again from the capture stage");
    if (std::string_view words = line; TakeWord(words) == "end_header") break;
    if (absl::Status status = ParseHeaderLine(line, header, has_format); !status.ok()) {
      return base::Annotate(status, fmt::format("header line {}", lines.line_number()));
    }
  }
  if (!has_format) return absl::InvalidArgumentError("the header has no 'format' line: the file is damaged");
  header.body = lines.Position();
  RETURN_IF_ERROR(CheckCounts(header, bytes.size() - header.body));
  return header;
}

}  // namespace vorocast::capture
