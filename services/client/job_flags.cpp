// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/client/job_flags.h"

#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "services/rendering/film_camera.h"
#include "services/simulation/effect.h"

namespace vorocast::client {
namespace {

std::optional<std::int32_t> ParseNumber(const std::string& text) {
  std::int32_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number < 0) return std::nullopt;
  return number;
}

std::string UserName() {
  const char* user = std::getenv("USER");
  return user && *user ? user : "unknown";
}

absl::StatusOr<std::string> ReadCamera(const std::string& path) {
  constexpr std::uintmax_t kBytesMax = 1 << 20;
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) return absl::NotFoundError(fmt::format("--camera {}: {}", path, error.message()));
  if (size > kBytesMax)
    return absl::InvalidArgumentError(fmt::format("--camera {}: {} bytes are no camera; at most {} are read", path, size, kBytesMax));
  std::ifstream file(path);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (json.is_discarded()) return absl::InvalidArgumentError(fmt::format("--camera {}: is not JSON", path));
  if (const auto read = rendering::CameraPathFromJson(json); !read.ok()) return base::Annotate(read.status(), path);
  return text;
}

}  // namespace

void CaptureFlags::AddTo(CLI::App& command) {
  command.add_option("--units", units, "Unit of the files' numbers: m, cm, mm, in or ft (capture.json, or m)");
  command.add_option("--up", up, "Axis of the files that points up: y, -y, z, … (capture.json, or y)");
  command.add_option("--fps", frames_per_second, "Frames a second (capture.json, or 25)")->check(CLI::Range(1.0, 1000.0));
  command.add_option("--name", name, "Name of the take (capture.json, or the folder's name)");
  command.add_option("--frames", frames, "Only these frames, as FIRST:END with END left out: 0:60 is the first sixty");
  command.add_option("--components", components, "Bodies expected, for a warning only: 2 for a dancer with a cage")->check(CLI::NonNegativeNumber);
}

void OntoFlags::AddTo(CLI::App& command) {
  command.add_option("--onto", folder, "Folder of a second take, which an effect with a morph turns this one into (--effect morph)");
  command.add_option("--onto-units", capture.units, "Unit of the second take's files (its capture.json, or m)");
  command.add_option("--onto-up", capture.up, "Axis of the second take's files that points up (its capture.json, or y)");
  command.add_option("--onto-fps", capture.frames_per_second, "Frames a second of the second take (its capture.json, or 25)")
      ->check(CLI::Range(1.0, 1000.0));
  command.add_option("--onto-name", capture.name, "Name of the second take (its capture.json, or the folder's name)");
  command.add_option("--onto-frames", capture.frames, "Only these frames of the second take, as FIRST:END");
}

absl::StatusOr<std::optional<capture::Capture>> OntoFlags::Open(const v1::SubmitJobRequest& request) const {
  const nlohmann::json effect = request.effect_json().empty() ? nlohmann::json() : nlohmann::json::parse(request.effect_json(), nullptr, false);
  RETURN_IF_ERROR(simulation::CheckSecondTake(effect, !folder.empty()));
  if (folder.empty()) return std::nullopt;
  auto options = capture.Parse();
  if (!options.ok()) return base::Annotate(options.status(), "the second take");
  ASSIGN_OR_RETURN(capture::Capture opened, capture::OpenCapture(folder, *options));
  return opened;
}

absl::Status ParseFrameRange(const std::string& text, capture::CaptureOptions& options) {
  const auto wrong = [&] {
    return absl::InvalidArgumentError(fmt::format("--frames {}: write FIRST:END, for example 0:60 for the first sixty frames", text));
  };
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) return wrong();
  const std::string first = text.substr(0, colon);
  const std::string last = text.substr(colon + 1);
  if (!first.empty()) {
    const auto number = ParseNumber(first);
    if (!number) return wrong();
    options.first = *number;
  }
  if (!last.empty()) {
    const auto number = ParseNumber(last);
    if (!number || *number <= options.first) return wrong();
    options.last = *number;
  }
  return absl::OkStatus();
}

absl::StatusOr<capture::CaptureOptions> CaptureFlags::Parse() const {
  capture::CaptureOptions options;
  if (!name.empty()) options.name = name;
  if (!units.empty()) options.unit = units;
  if (!up.empty()) options.up = up;
  if (frames_per_second > 0) options.frames_per_second = frames_per_second;
  if (components > 0) options.components = components;
  if (!frames.empty()) RETURN_IF_ERROR(ParseFrameRange(frames, options));
  return options;
}

void JobFlags::AddTo(CLI::App& command) {
  command.add_option("--cells", cells, "Voronoi cells of every frame and of the template")->capture_default_str()->check(CLI::Range(1, 200000));
  command.add_option("--iterations", iterations, "L-BFGS iterations a frame (the template gets 50)")
      ->capture_default_str()
      ->check(CLI::Range(0, 1000));
  command.add_option("--patches", patches, "Rigid patches of the template (200, or a twenty-fifth of the cells)")->check(CLI::Range(1, 200000));
  command.add_option("--template", template_frame, "Frame the template is made from, or auto: the one that touches itself least")
      ->capture_default_str();
  command.add_option("--window", window, "Frames tracked together")->capture_default_str()->check(CLI::Range(2, 1000));
  command.add_option("--bad-frames", bad_frames_max, "Frames that may fail and be interpolated before the job fails (a tenth of the take)")
      ->check(CLI::NonNegativeNumber);
  command.add_option(
      "--effect", effect,
      fmt::format("Effect to simulate: a JSON file (docs/effects.md), or a shipped one: {}", fmt::join(simulation::ShippedEffects(), ", ")));
  command.add_option("--indicator", indicator, "How points become a volume: spectral, or cgal (the slow reference)")
      ->capture_default_str()
      ->check(CLI::IsMember({"spectral", "cgal"}));
  command.add_option("--start", start, "Where sites start: lattice, or random as in the paper")
      ->capture_default_str()
      ->check(CLI::IsMember({"lattice", "random"}));
  command.add_option("--priority", priority, "Larger goes first")->capture_default_str();
  schedule.AddTo(command);
  command.add_flag("--no-sheets", no_sheets, "Make no contact sheets");
  command.add_flag("--film", film, "Render every instant as OpenEXR, and a movie of them (docs/film.md)");
  command.add_option("--film-size", film_size, "Width x height in pixels")->capture_default_str();
  command.add_option("--samples", samples, "Camera rays a pixel")->capture_default_str()->check(CLI::Range(1, 64));
  command.add_option("--shutter", shutter, "Part of the time between two pictures that it is open; 0: no motion blur")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0));
  command.add_option("--colour", colour, "Colours of the film: of the captured points, or of patches")
      ->capture_default_str()
      ->check(CLI::IsMember({"capture", "patch"}));
  command.add_option("--camera", camera, "JSON file with the film's camera (docs/film.md); left out, it shows the whole performance");
}

absl::StatusOr<v1::SubmitJobRequest> JobFlags::Parse() const {
  v1::SubmitJobRequest request;
  request.set_cells(cells);
  request.set_iterations(iterations);
  request.set_patches(patches);
  request.set_window_frames(window);
  request.set_interpolated_max(bad_frames_max);
  request.set_priority(priority);
  request.set_sheets(!no_sheets);
  request.set_indicator(indicator);
  request.set_start(start);
  request.set_user(UserName());
  RETURN_IF_ERROR(schedule.Fill(request));
  if (template_frame == "auto") {
    request.set_template_frame(-1);
  } else {
    const auto number = ParseNumber(template_frame);
    if (!number) return absl::InvalidArgumentError(fmt::format("--template {}: write a frame number, or auto", template_frame));
    request.set_template_frame(*number);
  }
  if (film) {
    v1::Film& asked = *request.mutable_film();
    int width = 0, height = 0, used = 0;
    if (std::sscanf(film_size.c_str(), "%dx%d%n", &width, &height, &used) != 2 || static_cast<std::size_t>(used) != film_size.size()) {
      return absl::InvalidArgumentError(fmt::format("--film-size {}: write WIDTHxHEIGHT, for example 1920x1080", film_size));
    }
    asked.set_width(width);
    asked.set_height(height);
    asked.set_samples(samples);
    asked.set_shutter(shutter);
    asked.set_colour(colour);
    if (!camera.empty()) {
      ASSIGN_OR_RETURN(*asked.mutable_camera_json(), ReadCamera(camera));
    }
  } else if (!camera.empty()) {
    return absl::InvalidArgumentError("--camera is for the film: give --film too");
  }
  if (!effect.empty()) {
    ASSIGN_OR_RETURN(const nlohmann::json loaded, simulation::LoadEffect(effect));
    request.set_effect_json(loaded.dump());
  }
  return request;
}

}  // namespace vorocast::client
