#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>

#include "server/slam/frame_features.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// Tracks the rotation of a camera without a map: before there is one, and while the camera is lost. This is possible
// only while the image moves as if the camera rotated in place, because its translation is small compared to the
// distance of the scene. Each frame is compared with a reference frame, which is replaced when its view is left, so the
// error grows slowly with the rotation.
class RotationTracker {
 public:
  explicit RotationTracker(const SlamConfig& config) : config_(config) {}

  // The rotation of the frame is known: the following frames are compared with it.
  void Start(std::shared_ptr<const FrameFeatures> frame, const Eigen::Quaterniond& R_world_camera);
  void Reset() { reference_ = nullptr; }
  bool HasStarted() const { return reference_ != nullptr; }
  // The rotation of the next frame. nullopt: the motion of the image does not fit a rotation.
  std::optional<Eigen::Quaterniond> Track(const std::shared_ptr<const FrameFeatures>& frame);

 private:
  const SlamConfig config_;
  std::shared_ptr<const FrameFeatures> reference_;
  Eigen::Quaterniond R_world_reference_ = Eigen::Quaterniond::Identity();
};

}  // namespace romap::slam
