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

// Match of one detection of a frame with a landmark.
struct Match {
  int landmark = -1;  // index into the landmarks; -1: no match
  // Reason why the detection must not update the landmark's shape and points; nullptr if it may. A detection with a
  // doubt but without a landmark does not create one.
  const char* doubt = nullptr;
  // Agreement of the mask with the landmark's body and cuboid, 0..1; nullopt while these are unknown or cut off.
  std::optional<double> agreement;
};

struct Association {
  std::vector<Match> matches;  // per detection
  // Per landmark: share of its body that is in the image and not under a mask, 0..1. 0 while it has no body.
  std::vector<double> visible_share;
  // Per landmark without a detection: index of the landmark whose mask covers most of its body, -1 if none does. Masks
  // with a doubt, for instance those that cover two objects, do not count.
  std::vector<int> covered_by;
};

// Scores every pair of landmark and detection and finds the best one-to-one assignment (AssignByScore). The score is
// the weighted mean of these cues:
//  - share of the landmark's body (map points and hull) that projects into the mask: valid from any direction and after
//    any gap in time;
//  - overlap (IoU) of the mask's box with the projected cuboid, and with the box of the last observation transformed by
//    the camera's motion while that observation is recent;
//  - class and detector track id, with small weights.
// A match is marked with a doubt if another one scores nearly as well, if the mask also covers a second landmark and
// fits both together better than the matched one (the detector merged two neighbors), and if two masks together fit one
// landmark better than the matched mask alone (the detector split an object).
//
// ObjectsConfig::association = "greedy_iou" selects the first stage of the paper instead: the boxes of consecutive
// frames are matched greedily, best overlap first.
//
// `frame_index` counts frames. `scene_depth_mu` is a typical depth for landmarks without geometry, 0 if unknown.
Association Associate(const TrackedFrame& tracked, const std::vector<Detection>& detections,
                      const std::vector<std::unique_ptr<Landmark>>& landmarks, uint64_t frame_index,
                      double scene_depth_mu, const ObjectsConfig& config);

}  // namespace romap::objects
