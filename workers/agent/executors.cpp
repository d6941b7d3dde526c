// SPDX-License-Identifier: AGPL-3.0-or-later
#include "workers/agent/executors.h"

#include "workers/agent/assemble_executor.h"
#include "workers/agent/encode_executor.h"
#include "workers/agent/guide_executor.h"
#include "workers/agent/render_executor.h"
#include "workers/agent/sheet_executor.h"
#include "workers/agent/stretch_executor.h"
#include "workers/agent/template_executor.h"
#include "workers/agent/tessellate_executor.h"
#include "workers/agent/track_executor.h"

namespace vorocast::agent {

std::vector<std::unique_ptr<lease::Executor>> AllExecutors() {
  std::vector<std::unique_ptr<lease::Executor>> executors;
  executors.push_back(std::make_unique<TessellateExecutor>());
  executors.push_back(std::make_unique<TemplateExecutor>());
  executors.push_back(std::make_unique<StretchExecutor>());
  executors.push_back(std::make_unique<GuideExecutor>());
  executors.push_back(std::make_unique<TrackExecutor>());
  executors.push_back(std::make_unique<AssembleExecutor>());
  executors.push_back(std::make_unique<SheetExecutor>());
  executors.push_back(std::make_unique<RenderExecutor>());
  executors.push_back(std::make_unique<EncodeExecutor>());
  return executors;
}

}  // namespace vorocast::agent
