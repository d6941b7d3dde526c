// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/agent/tessellate_executor.h"

#include "workers/agent/frame_cells.h"
#include "workers/agent/task_inputs.h"

namespace vorocast::agent {

absl::Status TessellateExecutor::Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                                         const base::Progress& progress) {
  ASSIGN_OR_RETURN(const auto options, OptionsOf<tasks::TessellateOptions>(spec));
  ASSIGN_OR_RETURN(const std::filesystem::path frame, PathOfOnly(spec, "frame", store));
  ASSIGN_OR_RETURN(const geometry::Cells cells, CellsOfFrame(frame, options, progress));
  return storage::WriteCells(output, cells, ProvenanceOf(spec, options.seed));
}

}  // namespace vorocast::agent
