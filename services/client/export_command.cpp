// SPDX-License-Identifier: AGPL-3.0-or-later
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "services/client/commands.h"
#include "services/client/percent_view.h"
#include "services/client/run_job.h"
#include "services/interchange/gltf.h"
#include "services/interchange/pieces.h"
#include "services/interchange/ply_sequence.h"
#include "services/interchange/point_cache.h"
#include "services/interchange/usd.h"

namespace vorocast::client {
namespace {

namespace fs = std::filesystem;

struct Format {
  const char* extension;  // of the default name; empty for a folder
  absl::Status (*write)(const interchange::MovingCells&, const fs::path&, const base::Progress&);
  bool has_objects;  // scene objects have a place in it
};

const std::map<std::string, Format>& Formats() {
  using interchange::MovingCells;
  using interchange::PointCache;
  static const std::map<std::string, Format> formats = {
      {"gltf", {".glb", &interchange::WriteGltf, true}},
      {"usd", {".usda", &interchange::WriteUsd, true}},
      {"ply", {"", &interchange::WritePlySequence, false}},
      {"pc2",
       {".pc2", [](const MovingCells& t, const fs::path& p, const base::Progress& g) { return WritePointCache(t, PointCache::kPc2, p, g); }, false}},
      {"mdd",
       {".mdd", [](const MovingCells& t, const fs::path& p, const base::Progress& g) { return WritePointCache(t, PointCache::kMdd, p, g); }, false}},
  };
  return formats;
}

struct ExportFlags {
  std::string take, format = "gltf", out, tracked;
  std::size_t every = 1;
};

/// The results' folder names the file: take1-out/take1-out.glb says more than "cells.glb" among other takes.
fs::path DefaultName(const ExportFlags& flags, const Format& format) {
  const fs::path take = fs::absolute(flags.take).lexically_normal();
  const bool is_folder = fs::is_directory(take);
  const fs::path folder = is_folder ? (take.has_filename() ? take : take.parent_path()) : take.parent_path();
  const std::string name = is_folder ? folder.filename().string() : take.stem().string();
  return folder / (*format.extension == '\0' ? name + "-ply" : name + format.extension);
}

/// "5000 cells, 812 copied cells, 3 scene objects": what there is of each.
std::string ContentOf(const interchange::MovingCells& take) {
  std::size_t copied = 0;
  std::size_t turning = 0;
  for (const interchange::Piece& piece : interchange::PiecesOf(take)) {
    copied += piece.copy >= 0;
    turning += piece.pair >= 0;
  }
  std::string content = fmt::format("{} cells", take.cell_count());
  if (copied > 0) content += fmt::format(", {} copied cells", copied);
  if (turning > 0) content += fmt::format(", {} cells that turn into another take's", turning);
  if (!take.objects.empty()) content += fmt::format(", {} scene object{}", take.objects.size(), take.objects.size() == 1 ? "" : "s");
  return content;
}

absl::Status Export(const ExportFlags& flags) {
  const Format& format = Formats().at(flags.format);
  ASSIGN_OR_RETURN(interchange::MovingCells take, interchange::ReadMovingCells(flags.take, flags.tracked));
  interchange::KeepEvery(flags.every, take);
  const fs::path out = flags.out.empty() ? DefaultName(flags, format) : fs::path(flags.out);
  if (fs::is_directory(out) && *format.extension != '\0')
    return absl::InvalidArgumentError(fmt::format("{}: is a folder; name a file", out.string()));
  PercentView view("Export");
  RETURN_IF_ERROR(format.write(take, out, [&](double fraction) { view.Show(fraction); }));
  view.Finish();
  fmt::print("Wrote {}: {} at {} instants, {:.2f} s\n", out.string(), ContentOf(take), take.instant_count(), take.time.back() - take.time.front());
  if (!format.has_objects && !take.objects.empty()) {
    std::vector<std::string> names;
    for (const geometry::SceneObject& object : take.objects) names.push_back(object.name);
    fmt::print("Left out, because {} carries cells only: {}. glTF and USD carry scene objects too.\n", flags.format, fmt::join(names, ", "));
  }
  return absl::OkStatus();
}

}  // namespace

void AddExportCommand(CLI::App& program, int& exit_code) {
  auto flags = std::make_shared<ExportFlags>();
  CLI::App& command = *program.add_subcommand("export", "Write a tracked or simulated take for other programs: glTF, USD, PLY, PC2 or MDD");
  command
      .add_option("take", flags->take,
                  "What 'run' or 'fetch' left: the folder (its simulated.h5 where there is one), a simulated.h5, or a tracked.h5")
      ->required();
  std::map<std::string, std::string> names;
  for (const auto& [name, format] : Formats()) names[name] = name;
  command
      .add_option("--format", flags->format,
                  "gltf: one animated node a cell, binary (.glb: Blender, Houdini, Unreal); usd: a PointInstancer as text (.usda);\n"
                  "ply: a folder with the visible surface of every instant; pc2, mdd: a point cache with its mesh (.obj) beside it")
      ->transform(CLI::IsMember(names))
      ->capture_default_str();
  command.add_option("--out", flags->out, "File to write, or folder for ply; by default beside the take");
  command.add_option("--tracked", flags->tracked, "The tracked.h5 that a simulated.h5 was run on, where it is not beside it");
  command.add_option("--every", flags->every, "Only every n-th instant")->check(CLI::PositiveNumber)->capture_default_str();
  command.footer("Metres, y up, seconds from the take's first frame. ParaView opens the .xdmf that lies beside tracked.h5 and simulated.h5.");
  command.callback([flags, &exit_code] {
    const absl::Status status = Export(*flags);
    exit_code = status.ok() ? 0 : PrintError(status);
  });
}

}  // namespace vorocast::client
