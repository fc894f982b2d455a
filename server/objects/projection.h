#pragma once

#include <Eigen/Core>
#include <opencv2/core/types.hpp>
#include <optional>
#include <span>
#include <utility>

#include "common/camera_model.h"
#include "common/cuboid.h"

namespace romap::objects {

// The pixel nearest to the projection of a point of the camera frame; nullopt behind the camera or outside the image.
std::optional<cv::Point> ProjectToPixel(const Eigen::Vector3d& p_camera, const CameraModel& camera);

// Bounding box of the projections of points of the camera frame, clipped to the image. Empty when a point is behind the
// camera or the whole box is outside the image.
cv::Rect BoundProjections(std::span<const Eigen::Vector3d> points_camera, const CameraModel& camera);

// Smallest and largest z depth of a cuboid's corners.
std::pair<double, double> DepthRange(const Cuboid& cuboid, const SE3<Camera, World>& T_camera_world);

// Intersection over union of two boxes in an image; 0 if both are empty.
double BoxIou(const cv::Rect& a, const cv::Rect& b);

// Bounding box of a projected cuboid, see BoundProjections().
cv::Rect ProjectCuboid(const Cuboid& cuboid, double enlargement, const CameraModel& camera,
                       const SE3<World, Camera>& T_world_camera);

}  // namespace romap::objects
