// SPDX-License-Identifier: AGPL-3.0-or-later
// cells.h5 and template.h5.
#include <cmath>

#include "services/storage/artifact_file.h"
#include "services/storage/cells_layout.h"
#include "services/storage/faults.h"

namespace vorocast::storage {

using geometry::Cells;
using geometry::Template;
using geometry::Vec3;

absl::Status WriteCells(const std::filesystem::path& path, const Cells& cells, const Provenance& provenance) {
  RETURN_IF_ERROR(RefuseToWrite(path, FaultIn(cells, "")));
  Hdf5Writer writer(path);
  WriteRoot(writer, kCellsContent, provenance);
  WriteCellsLayout(writer, "", cells);
  return writer.Finish();
}

absl::StatusOr<Cells> ReadCells(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const Hdf5Reader reader, OpenArtifact(path, kCellsContent));
  ASSIGN_OR_RETURN(Cells cells, ReadCellsLayout(reader, ""));
  if (const std::string fault = FaultIn(cells, ""); !fault.empty()) return reader.Wrong("values", fault);
  return cells;
}

absl::StatusOr<CellsSummary> ReadCellsSummary(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const Hdf5Reader reader, OpenArtifact(path, kCellsContent));
  CellsSummary summary;
  ASSIGN_OR_RETURN(summary.energy, reader.Attribute<double>("/", "energy"));
  ASSIGN_OR_RETURN(summary.surface_area, reader.Attribute<double>("/", "surface_area"));
  ASSIGN_OR_RETURN(summary.iterations, reader.Attribute<std::int32_t>("/", "iterations"));
  ASSIGN_OR_RETURN(const Shape sites, reader.ShapeOf<double>("/sites", {kAny, 3}));
  summary.cell_count = sites[0];
  if (summary.cell_count == 0) return reader.Wrong("/sites", "there are no cells");
  if (!std::isfinite(summary.energy) || !std::isfinite(summary.surface_area) || summary.iterations < 0) {
    return reader.Wrong("/@energy", "energy, surface_area or iterations is not a number that can be");
  }
  return summary;
}

absl::StatusOr<ObservedCells> ReadObservedCells(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const Hdf5Reader reader, OpenArtifact(path, kCellsContent));
  ObservedCells observed;
  ASSIGN_OR_RETURN(observed.surface, ReadSurface(reader, ""));
  ASSIGN_OR_RETURN(observed.centroid, (reader.Rows<double, double, 3, Vec3>("/cells/centroid", {kAny})));
  ASSIGN_OR_RETURN(observed.depth, reader.Dataset<double>("/cells/depth", {static_cast<std::int64_t>(observed.centroid.size())}));
  if (const std::string fault = FaultIn(observed); !fault.empty()) return reader.Wrong("values", fault);
  return observed;
}

absl::Status WriteTemplate(const std::filesystem::path& path, const Template& model, const Provenance& provenance) {
  RETURN_IF_ERROR(RefuseToWrite(path, FaultIn(model, "")));
  Hdf5Writer writer(path);
  WriteRoot(writer, kTemplateContent, provenance);
  WriteTemplateLayout(writer, "", model);
  return writer.Finish();
}

absl::StatusOr<Template> ReadTemplate(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const Hdf5Reader reader, OpenArtifact(path, kTemplateContent));
  ASSIGN_OR_RETURN(Template model, ReadTemplateLayout(reader, ""));
  if (const std::string fault = FaultIn(model, ""); !fault.empty()) return reader.Wrong("values", fault);
  return model;
}

}  // namespace vorocast::storage
