// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <vector>

#include "services/base/status.h"
#include "services/rendering/camera.h"
#include "services/rendering/scene.h"
#include "services/rendering/sheet.h"

/// Turns what is to be shown into what rays can meet.
namespace vorocast::rendering {

/// Discs that close the surface between the points: each as wide as the points around it are apart.
std::vector<Disc> MakeDiscs(const geometry::OrientedPoints& points);

/// Each cell's polyhedron where its pose puts it, shrunk towards its centroid; then the scene objects, grey.
std::vector<Triangles> MakeMeshes(const CellsPicture& picture, double shrink);

/// INVALID_ARGUMENT for arrays of different lengths.
absl::Status CheckPicture(const PointsPicture& picture);
absl::Status CheckPicture(const CellsPicture& picture);

/// Adds what the camera must show.
void AddBounds(const PointsPicture& picture, Bounds& bounds);
void AddBounds(const CellsPicture& picture, Bounds& bounds);

}  // namespace vorocast::rendering
