#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <deque>

#include "common/stage_messages.h"

namespace romap::slam {

// Estimates the up direction of the world from the gravity vectors of frames.
class UpEstimator {
 public:
  // Uses the frame's gravity_camera, if it has one, at the pose T_world_camera.
  void Add(const Frame& frame, const SE3<World, Camera>& T_world_camera);
  // The world was rotated: rotates all samples.
  void Rotate(const Eigen::Quaterniond& R_new_old);
  // Unit length, World frame: the mean over recent frames without samples far from their median, which the acceleration
  // of a hand-held camera causes. World z before the first gravity vector.
  const Eigen::Vector3d& up_world() const { return up_world_; }

 private:
  std::deque<Eigen::Vector3d> samples_;  // unit length, newest last
  Eigen::Vector3d up_world_ = Eigen::Vector3d::UnitZ();
};

}  // namespace romap::slam
