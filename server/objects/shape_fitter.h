#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <vector>

#include "common/stage_messages.h"
#include "server/objects/frame_detections.h"
#include "server/objects/landmark_store.h"
#include "server/objects/objects_config.h"
#include "server/objects/silhouette.h"

namespace romap::objects {

// Collects the silhouettes of landmarks and fits cuboids to them, a few at each keyframe (see fit_schedule.h).
class ShapeFitter {
 public:
  // Published cuboids of confirmed objects. They distinguish objects that may occlude a landmark from objects behind
  // it.
  using Cuboids = std::map<LandmarkKey, Cuboid>;

  explicit ShapeFitter(const ObjectsConfig& config) : config_(config) {}

  // Adds the unambiguous masks of a keyframe to the shapes of their landmarks, unless they are redundant.
  void AddSilhouettes(const KeyframeView& view, const FrameDetections& frame, const Cuboids& cuboids,
                      LandmarkStore* store) const;
  // Fits the most urgent landmarks, at most ObjectsConfig::cuboid_fits_per_keyframe. Returns their keys.
  std::vector<LandmarkKey> FitMostUrgent(uint64_t frame_index, const Cuboids& cuboids, LandmarkStore* store) const;
  // Fits all landmarks that changed or have no cuboid.
  void FitAll(uint64_t frame_index, const Cuboids& cuboids, LandmarkStore* store) const;

 private:
  struct NewSilhouette {
    Landmark* landmark = nullptr;
    const Detection* detection = nullptr;
    Silhouette silhouette;
  };

  static void FindSegments(const KeyframeView& view, std::vector<NewSilhouette>* silhouettes);

  ObjectsConfig config_;
};

}  // namespace romap::objects
