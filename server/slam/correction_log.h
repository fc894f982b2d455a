#pragma once

#include <map>
#include <unordered_map>
#include <vector>

#include "common/stage_messages.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Remembers what later stages were told of keyframes and points, and tells what has moved since. Small motions add up
// until they are worth a word.
class CorrectionLog {
 public:
  void Tell(const KeyframeView& view, double scale);
  // What moved since it was told; from now on it counts as told. Empty lists: nothing did.
  MapCorrection Take(const SlamMap& map);
  void Forget();

 private:
  struct Told {
    SE3<World, Camera> T_world_camera;
    double scale = 1;
    double depth_mu = 0;  // median, of what it saw: the measure of what is noticeable
  };
  struct ToldPoint {
    Eigen::Vector3d position_world;
    double noticeable_mu = 0;
  };

  std::map<KeyframeId, Told> keyframes_;
  std::map<MapPointId, ToldPoint> points_;
};

}  // namespace romap::slam
