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
#include "common/pose_uncertainty.h"
#include "common/scaled_pose.h"
#include "server/slam/features/feature.h"
#include "server/slam/optimize/radial_correction.h"
#include "server/slam/patch_search.h"

namespace romap::slam {

// The data needed to find a map point in a frame.
struct LocalPoint {
  MapPointId id;  // 0: a tentative point (tentative_points.h)
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction_world = Eigen::Vector3d::UnitZ();  // unit length, mean of its rays
  double size_mu = 0;                                          // of one pixel of its octave, at the point
  Descriptor descriptor{};
  std::shared_ptr<const ReferencePatch> patch = {};  // null: none yet
};

// A copy of the sparse map around the camera, made by the mapping thread for the tracking thread. Immutable, so that
// neither thread waits for the other.
struct LocalMap {
  uint64_t keyframes_done = 0;  // keyframes that are in the map
  int generation = 0;           // increases when another map becomes current, or does not as proposed
  SparseMapId map;              // see MapAtlas
  RadialCorrection lens;        // for the features of frames that are tracked against it
  KeyframeId reference;         // the newest keyframe
  int reference_points = 0;     // well-observed points that it observes
  PoseUncertainty reference_uncertainty;
  std::map<KeyframeId, ScaledPose> keyframes;  // the newest ones and those around `reference`
  std::vector<LocalPoint> points;
  std::unordered_map<MapPointId, int> index;  // into `points`
  Eigen::Vector3d up_world = Eigen::Vector3d::UnitZ();
  // The newest frame that was relocalized while tracking was lost.
  struct Relocalization {
    uint64_t frame_id = 0;
    SE3<World, Camera> T_world_camera;
  };
  std::optional<Relocalization> relocalized;
};

// Passes the newest local map from one thread to another.
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
