// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "services/lease/executor.h"

namespace vorocast::agent {

/// Rendered pictures in their order -> MP4. Inputs: "picture" OpenEXR files; one that is missing repeats the one before it.
class EncodeExecutor : public lease::Executor {
 public:
  tasks::Kind kind() const override { return tasks::Kind::kEncode; }
  absl::Status Execute(const tasks::TaskSpec& spec, const storage::ArtifactStore& store, const std::filesystem::path& output,
                       const base::Progress& progress) override;
};

}  // namespace vorocast::agent
