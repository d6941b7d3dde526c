// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/lease/executor.h"

namespace vorocast::agent {

/// Template, guide, in a long take the stretches that the window lies in, and the cells of one window's frames -> window.h5.
class TrackExecutor : public lease::Executor {
 public:
  tasks::Kind kind() const override { return tasks::Kind::kTrack; }
  absl::Status Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                       const base::Progress& progress) override;
};

}  // namespace vorocast::agent
