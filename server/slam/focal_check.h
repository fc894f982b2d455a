#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "common/diagnostic.h"
#include "common/geometry.h"
#include "server/slam/frame_features.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// Finds a focal length that fits given poses and images clearly better than the stated one. On a path around the scene,
// a wrong focal length scales everything about the center of the path, and neighboring frames agree with it nearly as
// well as with the right one. So frames are compared whose directions of view differ by tens of degrees: there, the
// perspective effects that a wrong focal length gets wrong are several pixels.
//
// Evidence: for each candidate, the squared distances of feature matches from the epipolar lines of the given motion,
// bounded against false matches. Noise of poses does not prefer the same focal length in nearly all pairs of frames.
class FocalCheck {
 public:
  explicit FocalCheck(const SlamConfig& config) : config_(config) {}

  // Call for each keyframe with a given pose.
  void AddFrame(const std::shared_ptr<const FrameFeatures>& frame, const SE3<World, Camera>& T_world_camera);
  std::optional<Diagnostic> Check() const;

 private:
  struct KeptFrame {
    std::shared_ptr<const FrameFeatures> features;
    SE3<World, Camera> T_world_camera;
  };
  // Two frames: per candidate, the mean squared distance, bounded, and the median distance. Shares of the image width.
  struct Pair {
    std::vector<double> costs = {};
    std::vector<double> medians = {};
  };

  void AddPair(const KeptFrame& first, const KeptFrame& second);

  const SlamConfig config_;
  std::deque<KeptFrame> kept_;  // the newest ones, some degrees apart
  std::deque<Pair> pairs_;      // the newest ones
  uint64_t first_frame_id_ = 0;
  int width_px_ = 0;
};

}  // namespace romap::slam
