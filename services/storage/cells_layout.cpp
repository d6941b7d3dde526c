// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/storage/cells_layout.h"

#include <algorithm>
#include <utility>

namespace vorocast::storage {

using geometry::Cells;
using geometry::OrientedPoints;
using geometry::Rgb8;
using geometry::Template;
using geometry::Vec3;

void WriteCellsLayout(Hdf5Writer& writer, const std::string& group, const Cells& cells) {
  const hsize_t n = cells.size();
  const hsize_t f = cells.neighbour.size();
  const hsize_t p = cells.surface.size();
  writer.Attribute(AttributeOwner(group), "energy", cells.energy);
  writer.Attribute(AttributeOwner(group), "iterations", cells.iterations);
  writer.Attribute(AttributeOwner(group), "surface_area", cells.surface_area);
  writer.Dataset<double>(group + "/sites", {n, 3}, reinterpret_cast<const double*>(cells.sites.data()));

  writer.Group(group + "/cells");
  writer.Dataset<double>(group + "/cells/volume", {n}, cells.volume.data());
  writer.Dataset<double>(group + "/cells/centroid", {n, 3}, reinterpret_cast<const double*>(cells.centroid.data()));
  writer.Dataset<std::uint8_t>(group + "/cells/boundary", {n}, cells.boundary.data());
  writer.Dataset<double>(group + "/cells/depth", {n}, cells.depth.data());
  writer.Dataset<std::int32_t>(group + "/cells/component", {n}, cells.component.data());
  writer.Dataset<std::int64_t>(group + "/cells/face_offset", {n + 1}, cells.face_offset.data());

  writer.Group(group + "/faces");
  writer.Dataset<std::int64_t>(group + "/faces/vertex_offset", {f + 1}, cells.vertex_offset.data());
  writer.Dataset<std::int32_t>(group + "/faces/vertex", {cells.vertex.size()}, cells.vertex.data());
  writer.Dataset<std::int32_t>(group + "/faces/neighbour", {f}, cells.neighbour.data());
  writer.Dataset<double>(group + "/vertices", {cells.vertices.size(), 3}, reinterpret_cast<const double*>(cells.vertices.data()));

  writer.Group(group + "/surface");
  writer.Dataset<double>(group + "/surface/points", {p, 3}, reinterpret_cast<const double*>(cells.surface.positions.data()));
  writer.Dataset<float>(group + "/surface/normals", {p, 3}, reinterpret_cast<const double*>(cells.surface.normals.data()));
  if (!cells.surface.colours.empty()) {
    writer.Dataset<std::uint8_t>(group + "/surface/colours", {p, 3}, reinterpret_cast<const std::uint8_t*>(cells.surface.colours.data()));
  }
}

absl::StatusOr<OrientedPoints> ReadSurface(const Hdf5Reader& reader, const std::string& group) {
  OrientedPoints surface;
  ASSIGN_OR_RETURN(surface.positions, (reader.Rows<double, double, 3, Vec3>(group + "/surface/points", {kAny})));
  const auto count = static_cast<std::int64_t>(surface.size());
  ASSIGN_OR_RETURN(surface.normals, (reader.Rows<float, double, 3, Vec3>(group + "/surface/normals", {count})));
  if (reader.Has(group + "/surface/colours")) {
    ASSIGN_OR_RETURN(surface.colours, (reader.Rows<std::uint8_t, std::uint8_t, 3, Rgb8>(group + "/surface/colours", {count})));
  }
  return surface;
}

absl::StatusOr<Cells> ReadCellsLayout(const Hdf5Reader& reader, const std::string& group) {
  Cells cells;
  ASSIGN_OR_RETURN(cells.energy, reader.Attribute<double>(AttributeOwner(group), "energy"));
  ASSIGN_OR_RETURN(cells.iterations, reader.Attribute<std::int32_t>(AttributeOwner(group), "iterations"));
  ASSIGN_OR_RETURN(cells.surface_area, reader.Attribute<double>(AttributeOwner(group), "surface_area"));
  ASSIGN_OR_RETURN(cells.sites, (reader.Rows<double, double, 3, Vec3>(group + "/sites", {kAny})));
  const auto n = static_cast<std::int64_t>(cells.size());

  ASSIGN_OR_RETURN(cells.volume, reader.Dataset<double>(group + "/cells/volume", {n}));
  ASSIGN_OR_RETURN(cells.centroid, (reader.Rows<double, double, 3, Vec3>(group + "/cells/centroid", {n})));
  ASSIGN_OR_RETURN(cells.boundary, reader.Dataset<std::uint8_t>(group + "/cells/boundary", {n}));
  ASSIGN_OR_RETURN(cells.depth, reader.Dataset<double>(group + "/cells/depth", {n}));
  ASSIGN_OR_RETURN(cells.component, reader.Dataset<std::int32_t>(group + "/cells/component", {n}));
  ASSIGN_OR_RETURN(cells.face_offset, reader.Dataset<std::int64_t>(group + "/cells/face_offset", {n + 1}));

  ASSIGN_OR_RETURN(cells.neighbour, reader.Dataset<std::int32_t>(group + "/faces/neighbour", {kAny}));
  const auto f = static_cast<std::int64_t>(cells.neighbour.size());
  ASSIGN_OR_RETURN(cells.vertex_offset, reader.Dataset<std::int64_t>(group + "/faces/vertex_offset", {f + 1}));
  ASSIGN_OR_RETURN(cells.vertex, reader.Dataset<std::int32_t>(group + "/faces/vertex", {kAny}));
  ASSIGN_OR_RETURN(cells.vertices, (reader.Rows<double, double, 3, Vec3>(group + "/vertices", {kAny})));
  ASSIGN_OR_RETURN(cells.surface, ReadSurface(reader, group));
  return cells;
}

void WriteTemplateLayout(Hdf5Writer& writer, const std::string& group, const Template& model) {
  WriteCellsLayout(writer, group, model.cells);
  writer.Attribute(AttributeOwner(group), "frame", model.frame);
  writer.Dataset<std::int32_t>(group + "/patch", {model.patch.size()}, model.patch.data());
}

absl::StatusOr<Template> ReadTemplateLayout(const Hdf5Reader& reader, const std::string& group) {
  Template model;
  ASSIGN_OR_RETURN(model.cells, ReadCellsLayout(reader, group));
  ASSIGN_OR_RETURN(model.frame, reader.Attribute<std::int32_t>(AttributeOwner(group), "frame"));
  ASSIGN_OR_RETURN(model.patch, reader.Dataset<std::int32_t>(group + "/patch", {static_cast<std::int64_t>(model.cells.size())}));
  // Every patch has a cell, so the largest index tells how many there are. One that cannot be right is left at zero for the caller's check.
  const std::int32_t last = model.patch.empty() ? -1 : *std::max_element(model.patch.begin(), model.patch.end());
  model.patch_count = std::cmp_less(last, model.patch.size()) ? last + 1 : 0;
  return model;
}

}  // namespace vorocast::storage
