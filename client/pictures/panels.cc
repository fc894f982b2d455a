#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "client/pictures/cuboids.h"
#include "client/pictures/pictures.h"

namespace romap::pictures {
namespace {

const cv::Scalar kWhite(255, 255, 255);

// A square region in pixel coordinates; may extend beyond the image.
struct Square {
  double left_px = 0;  // outer edge of the leftmost pixels
  double top_px = 0;
  double side_px = 1;
};

Square WholeImage(const CameraModel& camera) {
  const double side_px = std::max(camera.width_px, camera.height_px);
  return {0.5 * (camera.width_px - side_px) - 0.5, 0.5 * (camera.height_px - side_px) - 0.5, side_px};
}

// The bounding square, with a margin, of all points in front of the camera.
Square SquareAround(const std::vector<Eigen::Vector3d>& points_world, const CameraModel& camera,
                    const SE3<World, Camera>& T_world_camera) {
  constexpr double kMargin = 1.2;
  const SE3<Camera, World> T_camera_world = T_world_camera.Inverse();
  Eigen::AlignedBox2d bounds;
  for (const Eigen::Vector3d& p_world : points_world) {
    const Eigen::Vector3d p_camera = T_camera_world * p_world;
    if (p_camera.z() > 0) bounds.extend(camera.Project(p_camera));
  }
  if (bounds.isEmpty()) return WholeImage(camera);
  // Limits the square for an object that surrounds the camera.
  const double max_side_px = 2.0 * std::max(camera.width_px, camera.height_px);
  const double side_px = std::clamp(kMargin * bounds.sizes().maxCoeff(), 8.0, max_side_px);
  return {bounds.center().x() - 0.5 * side_px, bounds.center().y() - 0.5 * side_px, side_px};
}

// The camera whose image is the square, scaled to panel_side_px.
CameraModel CameraOfSquare(const CameraModel& camera, const Square& square, int panel_side_px) {
  const double scale = panel_side_px / square.side_px;
  CameraModel crop = camera;
  crop.width_px = crop.height_px = panel_side_px;
  crop.fx_px *= scale;
  crop.fy_px *= scale;
  crop.cx_px = (camera.cx_px - square.left_px) * scale - 0.5;
  crop.cy_px = (camera.cy_px - square.top_px) * scale - 0.5;
  return crop;
}

cv::Mat CropSquare(const cv::Mat& image_bgr, const Square& square, int panel_side_px) {
  const double scale = panel_side_px / square.side_px;
  const cv::Matx23d to_panel(scale, 0, -square.left_px * scale - 0.5, 0, scale, -square.top_px * scale - 0.5);
  cv::Mat panel;
  cv::warpAffine(image_bgr, panel, to_panel, {panel_side_px, panel_side_px}, cv::INTER_LINEAR, cv::BORDER_CONSTANT,
                 kWhite);
  return panel;
}

}  // namespace

cv::Mat DrawMeshBesideView(const render::MeshInstance& mesh, const cv::Mat& view_bgr, const CameraModel& camera,
                           const SE3<World, Camera>& T_world_camera, const Cuboid* cuboid, int panel_side_px) {
  std::vector<Eigen::Vector3d> points_world;
  for (const Eigen::Vector3f& vertex : mesh.mesh->vertices) {
    points_world.emplace_back(mesh.S_world_mesh * vertex.cast<double>());
  }
  if (cuboid != nullptr) {
    const std::array<Eigen::Vector3d, 8> corners = CuboidCorners(*cuboid);
    points_world.insert(points_world.end(), corners.begin(), corners.end());
  }
  const Square square = SquareAround(points_world, camera, T_world_camera);
  const CameraModel panel_camera = CameraOfSquare(camera, square, panel_side_px);

  cv::Mat photo = CropSquare(view_bgr, square, panel_side_px);
  if (cuboid != nullptr) DrawCuboidEdges(photo, panel_camera, T_world_camera, *cuboid, cv::Scalar(60, 200, 255));
  const std::span<const render::MeshInstance> instances(&mesh, 1);
  cv::Mat picture;
  cv::hconcat(
      std::vector<cv::Mat>{
          photo, render::RenderMeshes(instances, panel_camera, T_world_camera, render::MeshPaint::kShaded).color_bgr,
          render::RenderMeshes(instances, panel_camera, T_world_camera, render::MeshPaint::kColored).color_bgr},
      picture);
  return picture;
}

cv::Mat DrawOverview(std::span<const render::MeshInstance> meshes, std::span<const ObjectUpdate> objects,
                     const Eigen::Vector3d& up_world, const cv::Size& size_px) {
  Eigen::AlignedBox3d bounds;
  for (const render::MeshInstance& instance : meshes) {
    for (const Eigen::Vector3f& vertex : instance.mesh->vertices) {
      bounds.extend(instance.S_world_mesh * vertex.cast<double>());
    }
  }
  for (const ObjectUpdate& object : objects) {
    if (object.state == ObjectState::kLost) continue;
    for (const Eigen::Vector3d& corner : CuboidCorners(object.cuboid)) bounds.extend(corner);
  }
  if (bounds.isEmpty()) return {size_px, CV_8UC3, kWhite};

  CameraModel camera;
  camera.width_px = size_px.width;
  camera.height_px = size_px.height;
  camera.fx_px = camera.fy_px = size_px.width;
  camera.cx_px = 0.5 * (size_px.width - 1);
  camera.cy_px = 0.5 * (size_px.height - 1);
  constexpr double kElevation_rad = 0.75;
  const Eigen::Vector3d sideways = up_world.unitOrthogonal();
  const Eigen::Vector3d forward =
      std::cos(kElevation_rad) * sideways.cross(up_world) - std::sin(kElevation_rad) * up_world;
  Eigen::Matrix3d rotation;
  rotation << forward.cross(up_world).normalized(), forward.cross(forward.cross(up_world)).normalized(), forward;
  // The bounding sphere fits the smaller side of the image.
  const double half_view_rad = std::atan(0.5 * std::min(size_px.width, size_px.height) / camera.fx_px);
  const double distance_mu = std::max(0.5 * bounds.diagonal().norm(), 1e-12) / std::sin(half_view_rad);
  const SE3<World, Camera> T_world_camera(rotation, bounds.center() - distance_mu * forward);

  cv::Mat picture = render::RenderMeshes(meshes, camera, T_world_camera, render::MeshPaint::kColored).color_bgr;
  DrawCuboids(picture, camera, T_world_camera, objects);
  return picture;
}

}  // namespace romap::pictures
