#pragma once

#include <Eigen/Core>
#include <opencv2/core/types.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "common/camera_model.h"
#include "common/cuboid.h"

namespace romap::objects {

// The pixel nearest to the projection of a point of the camera frame; nullopt behind the camera or outside the image.
std::optional<cv::Point> ProjectToPixel(const Eigen::Vector3d& p_camera, const CameraModel& camera);

// Box around the projections of points of the camera frame, clipped to the image; empty when one of them is behind the
// camera or nothing is left.
cv::Rect BoundProjections(const std::vector<Eigen::Vector3d>& points_camera, const CameraModel& camera);

// The corners of a cuboid, its half extents times `enlargement`, in the world.
std::vector<Eigen::Vector3d> CuboidCorners(const Cuboid& cuboid, double enlargement);

// Least and greatest z depth of a cuboid's corners.
std::pair<double, double> DepthRange(const Cuboid& cuboid, const SE3<Camera, World>& T_camera_world);

// Box around a projected cuboid, as BoundProjections.
cv::Rect ProjectCuboid(const Cuboid& cuboid, double enlargement, const CameraModel& camera,
                       const SE3<World, Camera>& T_world_camera);

}  // namespace romap::objects
