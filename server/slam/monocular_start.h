#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/slam/frame_features.h"
#include "server/slam/geometry/two_view.h"
#include "server/slam/slam_config.h"

namespace romap {

// From what a map begins: two views without depth, or one with depth.
struct MapStart {
  std::shared_ptr<const FrameFeatures> first;
  std::shared_ptr<const FrameFeatures> second = {};  // none: `first` has depth
  SE3<Camera, Camera> T_first_second = {};           // its translation has length 1
  struct Point {
    int first_feature = 0;
    int second_feature = 0;
    Eigen::Vector3d p_first = Eigen::Vector3d::Zero();  // in the first camera's frame, in lengths of the baseline
  };
  std::vector<Point> points = {};
};

// Waits for two views that a map can begin with. A view is kept and followed from frame to frame until structure and
// motion come out of it and the newest frame (SolveTwoView), or too little of it is left.
class MonocularStart {
 public:
  explicit MonocularStart(const SlamConfig& config) : config_(config) {}

  // The next frame. Without a result, `reason` says why for people.
  std::optional<MapStart> Offer(std::shared_ptr<const FrameFeatures> sight, std::string* reason);
  void Reset() { first_ = nullptr; }

 private:
  struct Match {
    int first = 0;
    int second = 0;
  };
  void Begin(std::shared_ptr<const FrameFeatures> sight);
  std::vector<Match> Follow(const FrameFeatures& sight);

  const SlamConfig config_;
  std::shared_ptr<const FrameFeatures> first_;
  std::vector<Eigen::Vector2d> latest_px_;  // where each feature of `first_` was seen last
  int frames_since_first_ = 0;
};

}  // namespace romap
