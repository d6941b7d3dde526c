// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string_view>

#include "services/base/status.h"
#include "services/capture/frame_reader.h"

/// The formats of a frame, each parsed from the bytes of a whole file. What every parser keeps to:
/// memory stays within a fixed multiple of the bytes given, because a declared count is held against the bytes that follow it before anything
/// is allocated; triangle indices of the result are in range; normals and colours are as many as the vertices, or none; values may still be
/// non-finite (ReadFrame judges those). Errors are INVALID_ARGUMENT: the place (line, or element and its number), the reason, what to do.
namespace vorocast::capture {

/// Stanford PLY, ascii or binary of either byte order; any properties, list properties and further elements.
absl::StatusOr<RawFrame> ParsePly(std::string_view bytes);
/// Wavefront OBJ: v (with colours), vn, f with any of its four forms, negative indices, polygons.
absl::StatusOr<RawFrame> ParseObj(std::string_view bytes);
/// Object File Format in text, with the prefixes C, N and ST for colours, normals and texture coordinates.
absl::StatusOr<RawFrame> ParseOff(std::string_view bytes);
/// Draco meshes and point clouds of bitstream 2.2 and later.
absl::StatusOr<RawFrame> ParseDraco(std::string_view bytes);

/// By extension, lower case with the dot (IsFrameExtension).
absl::StatusOr<RawFrame> ParseFrame(std::string_view extension, std::string_view bytes);

}  // namespace vorocast::capture
