#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "common/camera_model.h"
#include "server/slam/features/feature.h"
#include "server/slam/frame_features.h"

namespace romap::slam {

// Finds features that are fixed to the camera, such as those on a gripper, a hand or an overlay. They stay at their
// pixels while most of the image moves, and would be triangulated as points that move with it. Features of a static
// camera stay too, so a feature counts as fixed only if it stayed while the scene moved several times.
class FixedFeatures {
 public:
  // Takes the features of the next frame. Returns per feature whether it is fixed to the camera.
  std::vector<uint8_t> Find(const CameraModel& camera, const std::vector<Feature>& features);

 private:
  // The features of an earlier frame.
  struct Reference {
    std::vector<Feature> features;
    FeatureGrid grid;
  };

  bool HasMovedSince(const Reference& reference, const CameraModel& camera, const std::vector<Feature>& features) const;

  std::deque<Reference> references_;  // oldest first; the scene moved between any two in a row
};

}  // namespace romap::slam
