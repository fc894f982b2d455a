#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "common/camera_model.h"

namespace romap {

// Where the pinhole camera.Pinhole() would see what `camera` sees at each of `pixels_px`, to better than 0.05 px.
// (NaN, NaN) where it would not see it at all: the ray leaves the lens sideways or backwards, or no ray meets the pixel
// by the lens's formula.
std::vector<Eigen::Vector2f> UndistortPixels(const CameraModel& camera, std::span<const Eigen::Vector2f> pixels_px);

// The other way round, for one pixel of the pinhole image: where `camera` sees it.
Eigen::Vector2d DistortPixel(const CameraModel& camera, const Eigen::Vector2d& pinhole_px);

// Maps for cv::remap, which turn an image of `camera` into that of camera.Pinhole(), of the same size.
struct UndistortionMaps {
  cv::Mat xy;        // CV_16SC2
  cv::Mat fraction;  // CV_16UC1
};
UndistortionMaps MakeUndistortionMaps(const CameraModel& camera);

}  // namespace romap
