// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "proto/jobs.pb.h"
#include "services/base/status.h"
#include "services/capture/capture.h"
#include "services/client/schedule_flags.h"

namespace vorocast::client {

/// --units, --up, --fps, --name, --frames, --components: what a capture's numbers mean.
struct CaptureFlags {
  std::string units, up, name, frames;
  double frames_per_second = 0;
  std::int32_t components = 0;

  void AddTo(CLI::App& command);
  absl::StatusOr<capture::CaptureOptions> Parse() const;
};

/// --onto, --onto-units, …: the second take that an effect with a morph turns the first into.
struct OntoFlags {
  std::string folder;
  CaptureFlags capture;

  void AddTo(CLI::App& command);
  /// Nothing when no second take is named. INVALID_ARGUMENT when the request's effect needs one and there is none, or has no use for one.
  absl::StatusOr<std::optional<capture::Capture>> Open(const v1::SubmitJobRequest& request) const;
};

/// --cells, --iterations, --patches, --template, --window, --effect, …: what is to be computed.
struct JobFlags {
  std::int32_t cells = 5000, iterations = 10, patches = 0, window = 10, bad_frames_max = -1, priority = 0;
  std::string template_frame = "auto", effect, indicator = "spectral", start = "lattice";
  bool no_sheets = false;
  bool film = false;
  std::string film_size = "1920x1080", colour = "capture", camera;
  std::int32_t samples = 4;
  double shutter = 0.5;
  ScheduleFlags schedule;

  void AddTo(CLI::App& command);
  /// Everything but the sequence. The effect is read and checked here, so that a mistake in it is told before anything is sent.
  absl::StatusOr<v1::SubmitJobRequest> Parse() const;
};

/// "12:40" is frames 12 … 39, ":60" the first sixty, "100:" all from the hundredth. INVALID_ARGUMENT otherwise.
absl::Status ParseFrameRange(const std::string& text, capture::CaptureOptions& options);

}  // namespace vorocast::client
