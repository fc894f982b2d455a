#pragma once

#include <opencv2/core/types.hpp>
#include <optional>

#include "common/camera_model.h"
#include "common/cuboid.h"

namespace romap::cli {

// Bounding box [px] of the projected corners of a cuboid. nullopt unless the whole cuboid is in front of the camera and
// inside the image.
std::optional<cv::Rect2d> CuboidOutline(const Cuboid& cuboid, const CameraModel& camera,
                                        const SE3<World, Camera>& T_world_camera);

}  // namespace romap::cli
