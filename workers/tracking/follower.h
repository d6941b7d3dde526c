// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include "workers/tracking/elastic_fit.h"
#include "workers/tracking/frame_fit.h"
#include "workers/tracking/tracking.h"

namespace vorocast::tracking {

/// The coarse association of the guide: wide at first, narrower with every iteration.
FitStage GuideStage(const GuideOptions& options, std::int32_t iteration, std::size_t points);

/// Follows a template coarsely from frame to frame in one direction: rigid patches find it, then they deform, lest they slide along the surface.
class Follower {
 public:
  /// `pose`: where the template is in `frame`.
  Follower(const PatchModel& model, FrameFit& fit, const GuideOptions& options, std::int32_t frame, Pose pose);

  /// Where the template may have been in a frame on the other side of the present one: a guess at its speed.
  void Expect(std::int32_t before_frame, Pose before) {
    before_frame_ = before_frame;
    before_ = std::move(before);
  }

  /// The template's pose in another frame.
  const Pose& Follow(std::int32_t frame, const ObservedFrame& observed);

 private:
  Pose Start(std::int32_t frame, const ObservedFrame& observed);
  void Deform(const ObservedFrame& observed, const Pose& found);

  const PatchModel& model_;
  FrameFit& fit_;
  ElasticFit elastic_;
  const GuideOptions& options_;
  std::int32_t now_frame_;
  Pose now_;
  Deformation deformation_;  // in now_frame_; now_ are the rigid poses nearest to it
  std::int32_t before_frame_ = 0;
  Pose before_;
};

absl::Status ValidateGuide(const std::vector<Observation>& frames, const GuideOptions& options);

}  // namespace vorocast::tracking
