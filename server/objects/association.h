#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "common/stage_messages.h"
#include "server/objects/detections.h"
#include "server/objects/landmark.h"
#include "server/objects/objects_config.h"

namespace romap::objects {

// What one detection of a frame shows.
struct Match {
  int landmark = -1;  // index into the landmarks; -1: none of them
  // The match is good enough to stay on track, but not to learn from: why. nullptr = nothing speaks against it. Without
  // a landmark: why it is not the sight of a new thing either.
  const char* doubt = nullptr;
  // How well the mask agrees with what is known of the landmark's shape, 0..1; nullopt while nothing is.
  std::optional<double> agreement;
};

// Which landmark each detection of a frame shows.
struct Association {
  std::vector<Match> matches;  // per detection
  // Per landmark: share of its body that this frame ought to show unless something is in front of it; 0 when unknown.
  std::vector<double> visible_share;
  // Per landmark without a detection: the landmark (index) whose mask lies over most of its body; -1: none. Not where
  // that mask plainly covers two things.
  std::vector<int> covered_by;
};

// Scores every pair by what is known of it and assigns globally (see AssignMaximal):
//  - share of the landmark's body (map points and hull) that projects into the mask: holds from any direction and after
//    any gap;
//  - overlap of the mask's box with the projected cuboid, and with the last sighting's box carried along by the
//    camera's motion, as long as that is recent;
//  - class and detector track: evidence, not a verdict.
// A match is doubted when another one is nearly as good, and when the mask covers a second landmark as well and fits
// both together better than one of them: neighbours that the detector took for one thing. So are two masks that fit one
// landmark together better than the matched one does alone: a thing that the detector cut in pieces.
//
// With ObjectsConfig::association = "greedy_iou" the recipe of the paper's first stage instead: boxes of consecutive
// frames, best overlap first.
//
// `frame_index` counts frames; `scene_depth_mu` is a typical distance for landmarks without geometry (0: unknown).
Association Associate(const TrackedFrame& tracked, const std::vector<Detection>& detections,
                      const std::vector<std::unique_ptr<Landmark>>& landmarks, uint64_t frame_index,
                      double scene_depth_mu, const ObjectsConfig& config);

}  // namespace romap::objects
