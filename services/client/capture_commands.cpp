// SPDX-License-Identifier: AGPL-3.0-or-later
#include <algorithm>
#include <memory>
#include <string>

#include <fmt/format.h>

#include "services/capture/inspect.h"
#include "services/client/commands.h"
#include "services/client/job_flags.h"
#include "services/client/percent_view.h"
#include "services/client/run_job.h"
#include "services/synth/synth.h"

namespace vorocast::client {
namespace {

void AddInspect(CLI::App& program, int& exit_code) {
  struct Flags {
    std::string folder;
    CaptureFlags capture;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App& command = *program.add_subcommand("inspect", "Read every frame of a capture and tell what is in it, and what is wrong with it");
  command.add_option("capture", flags->folder, "Folder with one file a frame: PLY, OBJ, OFF or Draco")->required();
  flags->capture.AddTo(command);
  command.callback([flags, &exit_code] {
    const auto inspect = [&]() -> absl::StatusOr<bool> {
      ASSIGN_OR_RETURN(const capture::CaptureOptions options, flags->capture.Parse());
      ASSIGN_OR_RETURN(const capture::Capture capture, capture::OpenCapture(flags->folder, options));
      PercentView view("Frames");
      ASSIGN_OR_RETURN(const capture::Inspection inspection, capture::InspectCapture(capture, [&](double fraction) { view.Show(fraction); }));
      view.Finish();
      fmt::print("{}", capture::Describe(inspection));
      return std::ranges::all_of(inspection.frames, [](const capture::FrameFacts& frame) { return frame.status.ok(); });
    };
    const auto usable = inspect();
    exit_code = !usable.ok() ? PrintError(usable.status()) : *usable ? 0 : 1;
  });
}

void AddSynth(CLI::App& program, int& exit_code) {
  struct Flags {
    std::string folder, from;
    synth::SynthOptions options;
    CaptureFlags source;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App& command =
      *program.add_subcommand("synth", "Make up a capture whose truth is known: a dancer with skirt and cage, scanned by a ring of depth cameras");
  command.add_option("folder", flags->folder, "Folder to write: frames, capture.json and truth.h5")->required();
  command.add_option("--count", flags->options.frames, "Frames to make up")->capture_default_str();
  command.add_option("--points", flags->options.points, "Points a frame")->capture_default_str();
  command.add_option("--noise", flags->options.noise_m, "Standard deviation of the depth, metres")->capture_default_str();
  command.add_option("--cameras", flags->options.cameras, "Depth cameras in the ring")->capture_default_str();
  command.add_option("--seed", flags->options.seed, "Another seed, other noise")->capture_default_str();
  command.add_option("--from", flags->from,
                     "Scan this folder of meshes of one connectivity instead; --units, --up, --fps and --frames say what it is");
  flags->source.AddTo(command);
  command.callback([flags, &exit_code] {
    const auto synthesise = [&]() -> absl::Status {
      PercentView view("Capture");
      const auto progress = [&](double fraction) { view.Show(fraction); };
      if (!flags->from.empty()) {
        ASSIGN_OR_RETURN(const capture::CaptureOptions source, flags->source.Parse());
        RETURN_IF_ERROR(synth::ScanMeshes(flags->from, source, flags->folder, flags->options, progress));
      } else {
        if (!flags->source.frames.empty() || !flags->source.units.empty() || !flags->source.up.empty() || !flags->source.name.empty()) {
          return absl::InvalidArgumentError(
              "--frames, --units, --up and --name describe the meshes of --from; --count is how many frames to make up");
        }
        if (flags->source.frames_per_second > 0) flags->options.frames_per_second = flags->source.frames_per_second;
        RETURN_IF_ERROR(synth::SynthesiseCapture(flags->folder, flags->options, progress));
      }
      view.Finish();
      fmt::print("Made {}: frames, capture.json, and the truth in truth.h5\n", flags->folder);
      return absl::OkStatus();
    };
    const absl::Status status = synthesise();
    exit_code = status.ok() ? 0 : PrintError(status);
  });
}

}  // namespace

void AddCaptureCommands(CLI::App& program, int& exit_code) {
  AddInspect(program, exit_code);
  AddSynth(program, exit_code);
}

}  // namespace vorocast::client
