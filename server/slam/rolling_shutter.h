#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "common/stage_messages.h"

namespace romap::slam {

// The motion of a camera while it reads one image: at time s * readout before or after the middle row, the pose is
// T_world_camera * Exp(s * motion), with s from -0.5 (first row) to 0.5 (last row).
struct ReadoutMotion {
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();    // rotation vector in the camera frame
  Eigen::Vector3d translation_mu = Eigen::Vector3d::Zero();  // in the camera frame
  double depth_mu = 0;  // of the scene, for pixels whose depth is unknown; 0: unknown, the translation is ignored
};

// Converts between the pixels and images of a rolling shutter and those that a global shutter would take at the time of
// the middle row. Velocities are constant during the readout. The whole image is converted as if all its points were at
// the depth of the scene, so points at another depth remain at slightly wrong pixels in the converted image. z depths
// are in the unit of the motion.
class RollingShutter {
 public:
  // `frame`: its cameras determine when a row of the pinhole image was read.
  RollingShutter(const Frame& frame, const ReadoutMotion& motion);

  // The share of the readout between the middle row and that of a pixel of the rolling image, -0.5 .. 0.5.
  double ReadAt(const Eigen::Vector2d& rolling_px) const;
  // The pixel of a global shutter that shows the same point. Pixels belong to the pinhole camera. `depth_mu`: z depth
  // of the point, 0 = that of the scene.
  Eigen::Vector2d ToGlobal(const Eigen::Vector2d& rolling_px, double depth_mu) const;
  // The inverse, by fixed-point iteration; accurate to 0.001 px, as rows are read faster than they move.
  Eigen::Vector2d ToRolling(const Eigen::Vector2d& global_px, double depth_mu) const;
  // From the converted image to a global shutter, for a point of known depth, and back.
  Eigen::Vector2d FromConverted(const Eigen::Vector2d& converted_px, double depth_mu) const {
    return ToGlobal(ToRolling(converted_px, 0), depth_mu);
  }
  Eigen::Vector2d ToConverted(const Eigen::Vector2d& global_px, double depth_mu) const {
    return ToGlobal(ToRolling(global_px, depth_mu), 0);
  }

  // The converted frame. It has no `source_gray`. `with_image`: otherwise only masks are converted; the image and the
  // depth image stay.
  std::shared_ptr<const Frame> Convert(const Frame& frame, bool with_image) const;
  // The same for label images, CV_16UC1.
  cv::Mat ConvertLabels(const cv::Mat& labels) const;

 private:
  double DepthOr(double depth_mu) const { return depth_mu > 0 ? depth_mu : motion_.depth_mu; }
  // Per pixel of the converted image its pixel in the recorded one, CV_32FC2.
  cv::Mat PixelMap() const;
  // Depth at the time of the middle row instead of the row's own time.
  cv::Mat DepthAtMiddleRow(const cv::Mat& depth_mu) const;

  CameraModel camera_;         // pinhole
  CameraModel source_camera_;  // with the distortion of the image that was read
  ReadoutMotion motion_;
};

// The shutter of a frame that was read during `motion`, whose depth_mu is replaced. null: a global shutter, or the
// motion is unknown.
std::shared_ptr<const RollingShutter> ShutterOf(const Frame& frame, std::optional<ReadoutMotion> motion,
                                                double depth_mu);

}  // namespace romap::slam
