#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap::synth {

// The poses of a camera while it records one image.
class ImagePoses {
 public:
  // Global shutter: all rows have the same pose.
  explicit ImagePoses(const SE3<World, Camera>& T_world_camera);
  // Rolling shutter: one pose per row of `camera`, at least one.
  ImagePoses(const CameraModel& camera, std::vector<SE3<World, Camera>> T_world_camera_of_row);

  bool Rolling() const { return rows_.size() > 1; }
  // Pose at a row, interpolated between pixel rows. Constant beyond the image.
  SE3<World, Camera> Row(double v_px) const;
  // A point in the camera frame of the row in which it is visible. For points outside the image, the nearest row; for
  // points behind the camera, the middle row.
  Eigen::Vector3d CameraPoint(const Eigen::Vector3d& p_world) const;

 private:
  Eigen::Vector3d CameraPointInRow(double v_px, const Eigen::Vector3d& p_world) const;

  struct Inverse {
    Eigen::Matrix3d rotation;
    Eigen::Vector3d translation;
  };

  CameraModel camera_;  // rolling shutter only
  std::vector<SE3<World, Camera>> rows_;
  std::vector<Inverse> inverses_;  // T_camera_world of rows_
};

}  // namespace romap::synth
