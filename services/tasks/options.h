// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "services/base/status.h"

/// The options of each kind of task. ToJson writes every field (so that defaults are part of the key); FromJson refuses an unknown
/// field, a wrong type or a value out of range with INVALID_ARGUMENT naming the field and what it may hold.
namespace vorocast::tasks {

/// A take of more frames than this would not fit the other bounds on a task either.
inline constexpr std::size_t kFramesMax = 20000;

/// How a captured file's numbers become metres, y up.
struct CaptureFrameOptions {
  double metres_per_unit = 1;  // 0.01 for centimetres
  std::string up = "+y";       // which axis of the file points up: one of +x -x +y -y +z -z
};

struct TessellateOptions {
  CaptureFrameOptions capture;
  std::int32_t cells = 5000;           // 1 … 200000
  std::int32_t iterations = 10;        // L-BFGS iterations, 0 … 1000
  std::string start = "lattice";       // "lattice": jittered BCC inside the shape; "random": uniform, as in the paper
  std::string indicator = "spectral";  // "spectral": FFT Poisson; "cgal": CGAL's Poisson, the reference
  std::uint64_t seed = 1;
};

/// A template is a tessellation of one frame with more iterations, and its patches.
struct TemplateOptions {
  TessellateOptions tessellate{.iterations = 50};
  std::int32_t frame = 0;      // frame number it is made from, or −1: "choose": the frame whose cells have the largest surface
  std::int32_t patches = 200;  // 1 … cells
};

/// A stretch is followed as the guide follows a take, by patches of one of its own frames.
struct StretchOptions {
  std::int32_t points = 6000;  // surface points used a frame
  std::int32_t iterations = 10;
  std::int32_t patches = 200;  // of that frame's cells
};

struct GuideOptions {
  std::int32_t points = 6000;  // surface points used a frame
  std::int32_t iterations = 10;
};

struct TrackOptions {
  std::int32_t iterations = 6;
  double regulariser = 0.3;      // how smoothly cells deform, against unit data weights
  double sigma_start_m = 0.010;  // soft-ICP scale, first and last iteration
  double sigma_end_m = 0.005;
  double normal_angle_max_deg = 45;  // θmax of the paper, section 4.3
  double depth_tolerance_m = 0.015;  // ε of the paper, section 4.3
  std::vector<std::int32_t> frames;  // the window's frame numbers, overlap included, ascending
};

struct AssembleOptions {
  double frames_per_second = 25;
  std::vector<std::int32_t> frames;    // every frame of the take, ascending
  std::int32_t interpolated_max = 10;  // more missing frames than this in the take, and the task fails
};

struct SimulateOptions {
  nlohmann::json effect;  // a whole effect (docs/effects.md), defaults filled in
};

struct SheetOptions {
  std::string stage = "cells";  // "points", "cells", "tracked", "simulated"
  std::int32_t pictures = 12;   // at most, spread evenly over the take
  std::int32_t width = 480;     // of one picture, pixels
  CaptureFrameOptions capture;  // for "points"
};

/// How a film looks: the same for all of its pictures.
struct FilmOptions {
  std::int32_t width = 1920;  // pixels, 16 … 16384
  std::int32_t height = 1080;
  std::int32_t samples = 4;                          // camera rays a pixel, 1 … 64; edges and motion get four times as many
  double shutter = 0.5;                              // part of the time between two pictures that it is open, 0 … 1
  std::string colour = "capture";                    // "capture": of the captured points, by patch where they have none; "patch"
  nlohmann::json camera = nlohmann::json::object();  // docs/film.md; empty: shows the whole performance
};

struct RenderOptions {
  FilmOptions film;
  std::int32_t instant = 0;  // of those stored in the take
};

struct EncodeOptions {
  double frames_per_second = 25;
};

nlohmann::json ToJson(const TessellateOptions&);
nlohmann::json ToJson(const TemplateOptions&);
nlohmann::json ToJson(const StretchOptions&);
nlohmann::json ToJson(const GuideOptions&);
nlohmann::json ToJson(const TrackOptions&);
nlohmann::json ToJson(const AssembleOptions&);
nlohmann::json ToJson(const SimulateOptions&);
nlohmann::json ToJson(const SheetOptions&);
nlohmann::json ToJson(const FilmOptions&);
nlohmann::json ToJson(const RenderOptions&);
nlohmann::json ToJson(const EncodeOptions&);

absl::Status FromJson(const nlohmann::json&, TessellateOptions&);
absl::Status FromJson(const nlohmann::json&, TemplateOptions&);
absl::Status FromJson(const nlohmann::json&, StretchOptions&);
absl::Status FromJson(const nlohmann::json&, GuideOptions&);
absl::Status FromJson(const nlohmann::json&, TrackOptions&);
absl::Status FromJson(const nlohmann::json&, AssembleOptions&);
absl::Status FromJson(const nlohmann::json&, SimulateOptions&);
absl::Status FromJson(const nlohmann::json&, SheetOptions&);
absl::Status FromJson(const nlohmann::json&, FilmOptions&);
absl::Status FromJson(const nlohmann::json&, RenderOptions&);
absl::Status FromJson(const nlohmann::json&, EncodeOptions&);

}  // namespace vorocast::tasks
