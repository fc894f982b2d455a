#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "common/camera_model.h"
#include "common/cuboid.h"

namespace romap::pictures {

// The corners of a cuboid [World, map units]. Corner i is at +half_extents along x, y, z of the Object frame if bit 0,
// 1, 2 of i is set, otherwise at -half_extents.
std::array<Eigen::Vector3d, 8> CuboidCorners(const Cuboid& cuboid);

// Draws the twelve edges of a cuboid, clipped at a near plane at one thousandth of its half diagonal. Returns the end
// pixels of the drawn segments; empty if nothing is visible.
std::vector<cv::Point> DrawCuboidEdges(cv::Mat& image_bgr, const CameraModel& camera,
                                       const SE3<World, Camera>& T_world_camera, const Cuboid& cuboid,
                                       const cv::Scalar& color_bgr);

}  // namespace romap::pictures
