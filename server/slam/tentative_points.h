#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "common/scaled_pose.h"
#include "server/slam/frame_features.h"
#include "server/slam/local_map.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// Points that tracking makes itself from the last frames. A fast camera needs them before mapping has added the newest
// keyframes to the map. They are as accurate as the poses of single frames, so they are used for a few frames only and
// never become part of the map.
class TentativePoints {
 public:
  explicit TentativePoints(const SlamConfig& config) : config_(config) {}

  void Reset() { frames_.clear(); }
  // Records a tracked frame. `points`: per feature, the map point that it observes, 0 = none. `depth_mu`: median of the
  // scene in the frame.
  void Record(std::shared_ptr<const FrameFeatures> frame, const SE3<World, Camera>& T_world_camera,
              std::vector<MapPointId> points, double depth_mu);
  // The map around a keyframe was corrected: the frames move with it.
  void Correct(const ScaledPose& before, const ScaledPose& after);

  // Points of those features of the newest frame that observe no map point: from its depth image, and by parallax with
  // the nearest earlier frame that has a sufficient baseline. Their ids are 0.
  std::vector<LocalPoint> Make() const;

 private:
  struct RecordedFrame {
    std::shared_ptr<const FrameFeatures> features;
    SE3<World, Camera> T_world_camera;
    std::vector<MapPointId> points;
    double depth_mu = 0;
  };

  const RecordedFrame* FindPartner() const;

  const SlamConfig config_;
  std::deque<RecordedFrame> frames_;
};

}  // namespace romap::slam
