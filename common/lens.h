#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "common/camera_model.h"

namespace romap {

// Converts pixels of `camera` to pixels of the pinhole camera.Pinhole(), with an error below 0.05 px. (NaN, NaN) for
// pixels without an equivalent: the ray is 90 degrees or more from the optical axis, or the distortion formula maps no
// ray to the pixel.
std::vector<Eigen::Vector2f> UndistortPixels(const CameraModel& camera, std::span<const Eigen::Vector2f> pixels_px);

// The inverse for one pixel: from the pinhole image to the image of `camera`.
Eigen::Vector2d DistortPixel(const CameraModel& camera, const Eigen::Vector2d& pinhole_px);

// The pixel of a point in the camera frame (z > 0) in the image of `camera`, with its distortion.
Eigen::Vector2d ProjectDistorted(const CameraModel& camera, const Eigen::Vector3d& p_camera);

// Maps for cv::remap that convert an image of `camera` to an image of camera.Pinhole() of the same size.
struct UndistortionMaps {
  cv::Mat xy;        // CV_16SC2
  cv::Mat fraction;  // CV_16UC1
};
UndistortionMaps MakeUndistortionMaps(const CameraModel& camera);

}  // namespace romap
