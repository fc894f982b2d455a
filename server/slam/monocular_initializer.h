#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/slam/frame_features.h"
#include "server/slam/geometry/two_view.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// The views from which a map is initialized: two without depth, or one with depth.
struct InitialViews {
  std::shared_ptr<const FrameFeatures> first;
  std::shared_ptr<const FrameFeatures> second = {};  // none: `first` has depth
  SE3<Camera, Camera> T_first_second = {};           // its translation has length 1
  struct Point {
    int first_feature = 0;
    int second_feature = 0;
    Eigen::Vector3d p_first = Eigen::Vector3d::Zero();  // in the first camera's frame, in units of the baseline
  };
  std::vector<Point> points = {};
};

// Searches for two views that can initialize a map. Follows the features of a few earlier views from frame to frame
// until SolveTwoView succeeds for one of them and the newest frame, or too few of its features are left.
class MonocularInitializer {
 public:
  explicit MonocularInitializer(const SlamConfig& config) : config_(config) {}

  // Processes the next frame. Without a result, `reason` is a text for users that explains why.
  std::optional<InitialViews> AddFrame(std::shared_ptr<const FrameFeatures> frame, std::string* reason);
  void Reset() { followed_.clear(); }

 private:
  struct Match {
    int first = 0;
    int second = 0;
  };
  struct FollowedView {
    std::shared_ptr<const FrameFeatures> frame;
    std::vector<Eigen::Vector2d> latest_px = {};  // last pixel of each feature
    std::vector<Match> matches = {};              // with the newest frame
    double motion_px = 0;                         // median over the matches
    int frames = 0;                               // since the view
  };

  void AddView(std::shared_ptr<const FrameFeatures> frame);
  void Follow(const FrameFeatures& frame, FollowedView& view) const;
  std::optional<InitialViews> TryToInitialize(const FollowedView& view,
                                              const std::shared_ptr<const FrameFeatures>& frame,
                                              std::string* reason) const;

  const SlamConfig config_;
  std::vector<FollowedView> followed_;  // oldest first
};

}  // namespace romap::slam
