#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/geometry.h"
#include "common/ids.h"
#include "common/scaled_pose.h"
#include "server/slam/features/feature.h"
#include "server/slam/optimize/radial_correction.h"

namespace romap::slam {

// What is needed to find a map point in a frame.
struct LocalPoint {
  MapPointId id;
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction_world = Eigen::Vector3d::UnitZ();  // unit length, mean of the rays that saw it
  double size_mu = 0;                                          // of one pixel of its octave, at the point
  Descriptor descriptor{};
};

// The part of the sparse map around the camera, as of one moment: what the mapping thread hands to the tracking thread.
// Immutable, so that neither ever waits for the other.
struct LocalMap {
  uint64_t keyframes_done = 0;                 // keyframes that are in the map
  int generation = 0;                          // grows when the map is begun anew
  RadialCorrection lens;                       // for the features of frames that are tracked against it
  KeyframeId reference;                        // the newest keyframe
  int reference_points = 0;                    // well-placed points that it sees
  std::map<KeyframeId, ScaledPose> keyframes;  // the newest ones and those around
  std::vector<LocalPoint> points;
  std::unordered_map<MapPointId, int> index;  // into `points`
  Eigen::Vector3d up_world = Eigen::Vector3d::UnitZ();
  // The newest frame that was found again while the camera was lost.
  struct Relocalization {
    uint64_t frame_id = 0;
    SE3<World, Camera> T_world_camera;
  };
  std::optional<Relocalization> relocalized;
};

// Hands the newest local map from one thread to another.
class LocalMapSlot {
 public:
  void Put(std::shared_ptr<const LocalMap> map) {
    std::lock_guard lock(mutex_);
    map_ = std::move(map);
  }
  // nullptr before the first Put.
  std::shared_ptr<const LocalMap> Get() const {
    std::lock_guard lock(mutex_);
    return map_;
  }

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const LocalMap> map_;
};

}  // namespace romap::slam
