// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "services/base/status.h"

namespace vorocast::capture {

enum class PlyEncoding { kAscii, kLittleEndian, kBigEndian };
enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

/// Bytes of one value in a binary file.
std::size_t SizeOf(PlyType type);
bool IsInteger(PlyType type);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat32;
  bool is_list = false;
  PlyType count_type = PlyType::kUint8;  // of a list
};

struct PlyElement {
  std::string name;
  std::int64_t count = 0;
  std::vector<PlyProperty> properties;

  /// Bytes that one of these takes at least (its lists empty); exactly, when it has no list.
  std::size_t MinimalBytes(PlyEncoding encoding) const;
};

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kAscii;
  std::vector<PlyElement> elements;  // in the order of the file
  std::size_t body = 0;              // offset of the first byte after the header
};

/// Also holds every declared count against the bytes that follow the header.
absl::StatusOr<PlyHeader> ParsePlyHeader(std::string_view bytes);

}  // namespace vorocast::capture
