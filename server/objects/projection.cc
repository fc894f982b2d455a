#include "server/objects/projection.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace romap::objects {
namespace {

constexpr double kMinDepth_mu = 1e-9;  // points nearer than this count as behind the camera; avoids division by zero

}  // namespace

std::optional<cv::Point> ProjectToPixel(const Eigen::Vector3d& p_camera, const CameraModel& camera) {
  if (!(p_camera.z() > kMinDepth_mu)) return std::nullopt;
  const Eigen::Vector2d pixel = camera.Project(p_camera).array() + 0.5;
  if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < camera.width_px && pixel.y() < camera.height_px)) {
    return std::nullopt;
  }
  return cv::Point(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()));
}

cv::Rect BoundProjections(std::span<const Eigen::Vector3d> points_camera, const CameraModel& camera) {
  Eigen::Vector2d low(camera.width_px, camera.height_px);
  Eigen::Vector2d high(-1, -1);
  for (const Eigen::Vector3d& p : points_camera) {
    if (!(p.z() > kMinDepth_mu)) return {};
    const Eigen::Vector2d pixel = camera.Project(p);
    low = low.cwiseMin(pixel);
    high = high.cwiseMax(pixel);
  }
  // Clip before rounding, because a corner near the camera plane may exceed the range of int.
  low = low.cwiseMax(Eigen::Vector2d::Zero());
  high = high.cwiseMin(Eigen::Vector2d(camera.width_px - 1, camera.height_px - 1));
  if (!(low.x() <= high.x() && low.y() <= high.y())) return {};
  const cv::Point first(static_cast<int>(std::floor(low.x())), static_cast<int>(std::floor(low.y())));
  const cv::Point last(static_cast<int>(std::ceil(high.x())), static_cast<int>(std::ceil(high.y())));
  return {first, last + cv::Point(1, 1)};
}

std::pair<double, double> DepthRange(const Cuboid& cuboid, const SE3<Camera, World>& T_camera_world) {
  const double center = (T_camera_world * cuboid.T_world_object.translation()).z();
  const Eigen::Vector3d depth_of_axes =
      (T_camera_world.RotationMatrix() * cuboid.T_world_object.RotationMatrix()).row(2).transpose();
  const double reach = depth_of_axes.cwiseAbs().dot(cuboid.half_extents);
  return {center - reach, center + reach};
}

double BoxIou(const cv::Rect& a, const cv::Rect& b) {
  const double both = (a & b).area();
  const double either = a.area() + b.area() - both;
  return either > 0 ? both / either : 0;
}

cv::Rect ProjectCuboid(const Cuboid& cuboid, double enlargement, const CameraModel& camera,
                       const SE3<World, Camera>& T_world_camera) {
  const SE3<Camera, World> T_camera_world = T_world_camera.Inverse();
  std::array<Eigen::Vector3d, 8> corners = CuboidCorners(cuboid, enlargement);
  for (Eigen::Vector3d& corner : corners) corner = T_camera_world * corner;
  return BoundProjections(corners, camera);
}

}  // namespace romap::objects
