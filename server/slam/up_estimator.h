#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <deque>

#include "common/stage_messages.h"

namespace romap::slam {

// Which way is up in the world: world z, unless frames bring gravity.
class UpEstimator {
 public:
  // Takes the frame's gravity_camera, if it has one, seen from the pose T_world_camera.
  void Add(const Frame& frame, const SE3<World, Camera>& T_world_camera);
  // The world was turned: what was seen before goes along.
  void Turn(const Eigen::Quaterniond& R_new_old);
  // Unit length, World frame: the mean over recent frames without those that lie far from their median (an
  // accelerometer of a hand that moves errs now and then), and world z before the first gravity.
  const Eigen::Vector3d& up_world() const { return up_world_; }

 private:
  std::deque<Eigen::Vector3d> samples_;  // unit length, newest last
  Eigen::Vector3d up_world_ = Eigen::Vector3d::UnitZ();
};

}  // namespace romap::slam
