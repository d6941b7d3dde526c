// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>

#include "services/geometry/cells.h"
#include "services/geometry/tracked_take.h"
#include "services/storage/hdf5_reader.h"
#include "services/storage/hdf5_writer.h"

/// The layouts that several files share, below a group ("" for the root, or "/template"). Private to services/storage.
namespace vorocast::storage {

void WriteCellsLayout(Hdf5Writer& writer, const std::string& group, const geometry::Cells& cells);
absl::StatusOr<geometry::Cells> ReadCellsLayout(const Hdf5Reader& reader, const std::string& group);
absl::StatusOr<geometry::OrientedPoints> ReadSurface(const Hdf5Reader& reader, const std::string& group);

void WriteTemplateLayout(Hdf5Writer& writer, const std::string& group, const geometry::Template& model);
absl::StatusOr<geometry::Template> ReadTemplateLayout(const Hdf5Reader& reader, const std::string& group);

/// The object that carries a group's attributes: the group, or "/".
inline std::string AttributeOwner(const std::string& group) { return group.empty() ? "/" : group; }

}  // namespace vorocast::storage
