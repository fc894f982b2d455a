#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "common/messages.h"
#include "server/objects/detections.h"
#include "server/objects/landmark.h"
#include "server/objects/objects_config.h"

namespace romap {

// Which landmark each detection of a frame shows.
struct Association {
  std::vector<int> landmark_of_detection;  // index into the landmarks, or -1
  // The match could as well be another one: good enough to stay on track, not to learn from.
  std::vector<bool> ambiguous;
  // Per landmark: share of its body that this frame ought to show unless something is in front of it; 0 when unknown.
  std::vector<double> visible_share;
};

// Scores every pair by what is known of it and assigns globally (see AssignMaximal):
//  - share of the landmark's body (map points and hull) that projects into the mask: holds from any direction and after
//    any gap;
//  - overlap of the mask's box with the projected cuboid, and with the last sighting's box carried along by the
//  camera's
//    motion, as long as that is recent;
//  - class and detector track: evidence, not a verdict.
// `frame_index` counts frames; `scene_depth_mu` is a typical distance for landmarks without geometry (0: unknown).
Association Associate(const TrackedFrame& tracked, const std::vector<Detection>& detections,
                      const std::vector<std::unique_ptr<Landmark>>& landmarks, uint64_t frame_index,
                      double scene_depth_mu, const ObjectsConfig& config);

}  // namespace romap
