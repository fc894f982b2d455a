#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "common/camera_model.h"
#include "common/cuboid.h"

namespace romap::pictures {

// Draws the twelve edges of a cuboid, clipped at a near plane at one thousandth of its half diagonal. Returns the end
// pixels of the drawn segments; empty if nothing is visible.
std::vector<cv::Point> DrawCuboidEdges(cv::Mat& image_bgr, const CameraModel& camera,
                                       const SE3<World, Camera>& T_world_camera, const Cuboid& cuboid,
                                       const cv::Scalar& color_bgr);

}  // namespace romap::pictures
