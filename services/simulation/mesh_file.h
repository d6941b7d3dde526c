// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

#include "services/base/status.h"
#include "services/geometry/triangle_mesh.h"

namespace vorocast::simulation {

/// An artist's mesh: OBJ, PLY, OFF or Draco (the capture readers, which believe nothing that a file says of itself), glTF or GLB (all meshes of
/// the scene, each where its nodes put it). NOT_FOUND, or INVALID_ARGUMENT with path and reason: no triangles, more than 20000 of them or of their
/// corners, values that are not finite.
absl::StatusOr<geometry::TriangleMesh> ReadMeshFile(const std::filesystem::path& path);

/// Replaces each object's "file", relative to `folder`, by the vertices and triangles that are in it. So an effect carries its meshes in
/// its own bytes: it means the same on every machine, they are part of its results' key, and they travel without a second upload.
/// What does not look like an effect is left for the schema to refuse.
absl::Status EmbedMeshFiles(nlohmann::json& effect, const std::filesystem::path& folder);

}  // namespace vorocast::simulation
