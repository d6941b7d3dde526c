// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "services/storage/hdf5_artifacts.h"
#include "services/storage/hdf5_reader.h"
#include "services/storage/hdf5_writer.h"

/// Private to services/storage: what all artifact files have in common (docs/storage_format.md, "Root attributes").
namespace vorocast::storage {

inline constexpr std::string_view kFormatName = "vorocast";
inline constexpr std::int32_t kFormatVersion = 1;

/// What a file holds; the root attribute `content`.
inline constexpr std::string_view kCellsContent = "cells";
inline constexpr std::string_view kTemplateContent = "template";
inline constexpr std::string_view kPosesContent = "poses";
inline constexpr std::string_view kStretchContent = "stretch";
inline constexpr std::string_view kTrackedContent = "tracked";
inline constexpr std::string_view kSimulatedContent = "simulated";

void WriteRoot(Hdf5Writer& writer, std::string_view content, const Provenance& provenance);

/// Opens an artifact and refuses another format, a newer version or other content than asked for.
absl::StatusOr<Hdf5Reader> OpenArtifact(const std::filesystem::path& path, std::string_view content);

/// The content of any artifact, format and version checked.
absl::StatusOr<std::string> ReadContent(const std::filesystem::path& path);

/// INTERNAL with the path when `fault` is not empty: a kernel made a result that no reader would accept.
absl::Status RefuseToWrite(const std::filesystem::path& path, const std::string& fault);

}  // namespace vorocast::storage
