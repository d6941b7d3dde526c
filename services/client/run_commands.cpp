// SPDX-License-Identifier: AGPL-3.0-or-later
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "services/client/commands.h"
#include "services/client/embedded_service.h"
#include "services/client/job_flags.h"
#include "services/client/percent_view.h"
#include "services/client/run_job.h"
#include "services/synth/synth.h"

namespace vorocast::client {
namespace {

struct PlaceFlags {
  std::string out, state;
  std::int32_t workers = 0;

  void AddTo(CLI::App& command) {
    command.add_option("--out", out, "Folder for the results (vorocast-out/NAME)");
    command.add_option("--state", state, "Folder for the service's state and all results, used again by later runs (~/.cache/vorocast)");
    command.add_option("--workers", workers, "Worker processes (one a processor)")->check(CLI::Range(1, 1024));
  }
  RunOptions Parse(const std::string& name) const {
    return {out.empty() ? std::filesystem::path("vorocast-out") / name : std::filesystem::path(out),
            state.empty() ? DefaultStateFolder() : std::filesystem::path(state), workers};
  }
};

void AddRun(CLI::App& program, int& exit_code) {
  struct Flags {
    std::string folder;
    CaptureFlags capture;
    OntoFlags onto;
    JobFlags job;
    PlaceFlags place;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App& command = *program.add_subcommand("run", "Do the whole job on this machine: frames in, cells, tracked take, effect and pictures out");
  command.add_option("capture", flags->folder, "Folder with one file a frame: PLY, OBJ, OFF or Draco")->required();
  flags->capture.AddTo(command);
  flags->onto.AddTo(command);
  flags->job.AddTo(command);
  flags->place.AddTo(command);
  command.footer(
      "Stopped or killed, the same command goes on where it was. Another effect on the same take computes only the effect.\n"
      "Example: vorocast run take1 --units cm --up -y --fps 30 --effect pendulum --out take1-pendulum\n"
      "Two takes: vorocast run take1 --onto take2 --effect morph --out take1-morph");
  command.callback([flags, &exit_code] {
    const auto run = [&]() -> absl::StatusOr<int> {
      ASSIGN_OR_RETURN(const capture::CaptureOptions options, flags->capture.Parse());
      ASSIGN_OR_RETURN(const v1::SubmitJobRequest request, flags->job.Parse());
      ASSIGN_OR_RETURN(const std::optional<capture::Capture> onto, flags->onto.Open(request));
      ASSIGN_OR_RETURN(const capture::Capture capture, capture::OpenCapture(flags->folder, options));
      return RunJob(capture, onto ? &*onto : nullptr, request, flags->place.Parse(capture.name));
    };
    const auto code = run();
    exit_code = code.ok() ? *code : PrintError(code.status());
  });
}

void AddDemo(CLI::App& program, int& exit_code) {
  struct Flags {
    std::int32_t frames = 40;
    JobFlags job;
    PlaceFlags place;
  };
  auto flags = std::make_shared<Flags>();
  flags->job.effect = "pendulum";
  CLI::App& command = *program.add_subcommand("demo", "Make up a capture, then do the whole job on it");
  command.add_option("--frames", flags->frames, "Frames of the made-up capture")->capture_default_str()->check(CLI::Range(2, 10000));
  flags->job.AddTo(command);
  flags->place.AddTo(command);
  command.callback([flags, &exit_code] {
    const auto demo = [&]() -> absl::StatusOr<int> {
      ASSIGN_OR_RETURN(const v1::SubmitJobRequest request, flags->job.Parse());
      RETURN_IF_ERROR(OntoFlags{}.Open(request).status());  // the made-up capture is one take
      const RunOptions place = flags->place.Parse("demo");
      const std::filesystem::path folder = place.out / fmt::format("capture-{}", flags->frames);
      synth::SynthOptions options;
      options.frames = flags->frames;
      // A capture made by an earlier call is used again; capture.json is written last, so a half-made one is recognised.
      if (!std::filesystem::exists(folder / "capture.json")) {
        fmt::print("Making up a capture of {} frames in {}\n", options.frames, folder.string());
        std::error_code ignored;
        std::filesystem::remove_all(folder, ignored);
        PercentView view("Capture");
        RETURN_IF_ERROR(synth::SynthesiseCapture(folder, options, [&](double fraction) { view.Show(fraction); }));
        view.Finish();
      }
      ASSIGN_OR_RETURN(const capture::Capture capture, capture::OpenCapture(folder, {}));
      const int code = RunJob(capture, nullptr, request, place);
      if (code == 0) {
        fmt::print("\nLook at {0}/sheets/: points.png, cells.png, tracked.png, simulated.png\n",
                   std::filesystem::absolute(place.out).lexically_normal().string());
        fmt::print("Your own take: vorocast run FOLDER --units cm --up -y --fps 30 --effect pendulum\n");
      }
      return code;
    };
    const auto code = demo();
    exit_code = code.ok() ? *code : PrintError(code.status());
  });
}

}  // namespace

void AddRunCommands(CLI::App& program, int& exit_code) {
  AddRun(program, exit_code);
  AddDemo(program, exit_code);
}

}  // namespace vorocast::client
