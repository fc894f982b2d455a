#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "common/camera_model.h"
#include "common/cuboid.h"

namespace romap::pictures {

// Corner i lies at +half_extents along x, y, z of the Object frame where bit 0, 1, 2 of i is set, else at
// -half_extents. World frame, map units.
std::array<Eigen::Vector3d, 8> CuboidCorners(const Cuboid& cuboid);

// Draws the twelve edges and returns the pixels their visible pieces end at (none: nothing was drawn). The near plane
// lies at one thousandth of the cuboid's half diagonal.
std::vector<cv::Point> DrawCuboidEdges(cv::Mat& image_bgr, const CameraModel& camera,
                                       const SE3<World, Camera>& T_world_camera, const Cuboid& cuboid,
                                       const cv::Scalar& color_bgr);

}  // namespace romap::pictures
