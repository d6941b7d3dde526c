// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/try_effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <optional>

#include "services/rendering/sheet.h"
#include "services/rendering/simulated_picture.h"
#include "services/simulation/effect.h"
#include "services/simulation/simulate.h"
#include "services/storage/hdf5_artifacts.h"

namespace vorocast::simulation {
namespace {

double CpuSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

absl::Status DrawSheet(const geometry::TrackedTake& take, const geometry::SimulatedTake& result, const std::string& name, const TryOptions& options) {
  const auto first = static_cast<std::size_t>(std::ranges::lower_bound(result.time, options.from_s) - result.time.begin());
  const std::size_t last = result.time.size() - 1;
  std::vector<rendering::CellsPicture> pictures;
  for (int i = 0; i < options.pictures && first <= last; ++i) {
    const double share = options.pictures == 1 ? 0 : static_cast<double>(i) / (options.pictures - 1);
    pictures.push_back(
        rendering::PictureOf(take.model, result, first + static_cast<std::size_t>(std::lround(share * static_cast<double>(last - first)))));
  }
  const rendering::SheetLayout layout{.picture_width = options.width, .title = name};
  ASSIGN_OR_RETURN(const rendering::Image sheet, rendering::RenderSheet(pictures, layout, {}));
  return rendering::WritePng(options.sheet, sheet);
}

}  // namespace

absl::Status TryEffect(const TryOptions& options) {
  ASSIGN_OR_RETURN(const nlohmann::json effect, LoadEffect(options.effect));
  ASSIGN_OR_RETURN(const geometry::TrackedTake take, storage::ReadTrackedTake(options.tracked));
  std::optional<geometry::TrackedTake> onto;
  if (!options.onto.empty()) {
    ASSIGN_OR_RETURN(onto, storage::ReadTrackedTake(options.onto));
  }
  const double before = CpuSeconds();
  ASSIGN_OR_RETURN(const geometry::SimulatedTake result, Simulate(take, effect, {}, {}, onto ? &*onto : nullptr));
  const double cpu_s = CpuSeconds() - before;
  fmt::print("{}: {} cells, {:.2f} s stored as {} frames, {} steps, {:.2f} s CPU, {:.2f} ms a step\n", effect["name"].get<std::string>(),
             take.cell_count(), result.time.back(), result.time.size(), result.step_count, cpu_s,
             1e3 * cpu_s / std::max(1.0, static_cast<double>(result.step_count)));
  fmt::print("deepest penetration: cells {:.1f} mm (overlapping when they began to collide: {:.1f} mm), objects {:.1f} mm, ground {:.1f} mm\n",
             1e3 * result.cell_penetration_m, 1e3 * result.cell_overlap_m, 1e3 * result.object_penetration_m, 1e3 * result.ground_penetration_m);
  if (!options.out.empty()) {
    RETURN_IF_ERROR(storage::WriteSimulatedTake(options.out, result, {.kind = "simulate", .options_json = effect.dump()}));
  }
  return options.sheet.empty() ? absl::OkStatus() : DrawSheet(take, result, effect["name"], options);
}

}  // namespace vorocast::simulation
