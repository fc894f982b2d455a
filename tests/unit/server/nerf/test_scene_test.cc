#include "tests/unit/server/nerf/test_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

namespace romap::testing_support {
namespace {

CameraModel SquareCamera(int size_px) {
  CameraModel camera;
  camera.width_px = camera.height_px = size_px;
  camera.fx_px = camera.fy_px = 1.4 * size_px;
  camera.cx_px = camera.cy_px = 0.5 * (size_px - 1);
  return camera;
}

SE3<World, Camera> LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d forward = (target - eye).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d axes;
  axes << right, forward.cross(right), forward;
  return {axes, eye};
}

cv::Vec3b Stripes(const Eigen::Vector3d& normal) {
  const double azimuth = std::atan2(normal.y(), normal.x()), height = std::asin(std::clamp(normal.z(), -1.0, 1.0));
  const auto byte = [](double x) { return static_cast<uint8_t>(127.5 + 100 * x); };
  return {byte(std::sin(5 * azimuth)), byte(std::cos(7 * height)), byte(std::sin(4 * (azimuth + height)))};
}

// The distance to the ball along the unit direction; < 0: no intersection.
double HitBall(const Eigen::Vector3d& origin_to_center, const Eigen::Vector3d& direction, double radius) {
  const double along = origin_to_center.dot(direction);
  const double square = radius * radius - (origin_to_center.squaredNorm() - along * along);
  return square < 0 ? -1 : along - std::sqrt(square);
}

TEST(BallSceneTest, RendersTheBallWhereTheCameraModelProjectsIt) {
  const BallScene scene;
  const ObjectView view = scene.View(0);
  const Eigen::Vector3d center_camera = view.T_world_camera.Inverse() * scene.Center();
  const Eigen::Vector2d pixel = view.camera.Project(center_camera);
  EXPECT_EQ(view.ray_kind.at<uint8_t>(static_cast<int>(pixel.y()), static_cast<int>(pixel.x())),
            static_cast<uint8_t>(RayKind::kObject));
  EXPECT_EQ(view.ray_kind.at<uint8_t>(0, 0), static_cast<uint8_t>(RayKind::kBackground));
}

}  // namespace

Cuboid BallScene::Box() const {
  return {SE3<World, Object>(Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ())), Center()),
          Eigen::Vector3d::Constant(radius_mu), 1.0};
}

ObjectView BallScene::View(int index) const {
  const double azimuth = 2 * std::numbers::pi * index / views;
  const double elevation = index % 2 == 0 ? 0.35 : -0.5;
  const Eigen::Vector3d away(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                             std::sin(elevation));
  ObjectView view;
  view.object = object;
  view.keyframe = KeyframeId{static_cast<uint64_t>(index) + 1};
  view.camera = SquareCamera(size_px);
  view.T_world_camera = LookAt(Center() + 4.5 * radius_mu * away, Center());
  view.roi_px = {0, 0, size_px, size_px};
  view.color_bgr = cv::Mat(size_px, size_px, CV_8UC3, cv::Scalar(40, 60, 50));
  view.ray_kind = cv::Mat(size_px, size_px, CV_8UC1, cv::Scalar(static_cast<int>(RayKind::kBackground)));
  if (with_depth) view.depth_mu = cv::Mat(size_px, size_px, CV_32FC1, cv::Scalar(0));
  for (int v = 0; v < size_px; ++v) {
    for (int u = 0; u < size_px; ++u) {
      const Eigen::Vector3d ray_camera = view.camera.Unproject(u, v);
      const Eigen::Vector3d direction = view.T_world_camera.rotation() * ray_camera.normalized();
      const Eigen::Vector3d eye = view.T_world_camera.translation();
      const double distance = HitBall(Center() - eye, direction, radius_mu);
      if (distance < 0) continue;
      view.color_bgr.at<cv::Vec3b>(v, u) = Stripes((eye + distance * direction - Center()) / radius_mu);
      view.ray_kind.at<uint8_t>(v, u) = static_cast<uint8_t>(RayKind::kObject);
      if (with_depth) view.depth_mu.at<float>(v, u) = static_cast<float>(distance / ray_camera.norm());
    }
  }
  return view;
}

std::vector<ObjectView> BallScene::Views() const {
  std::vector<ObjectView> all;
  for (int i = 0; i < views; ++i) all.push_back(View(i));
  return all;
}

nerf::NerfConfig SmallFieldConfig() {
  nerf::NerfConfig config;
  config.levels = 6;
  config.log2_table_entries = 12;
  config.finest_resolution = 128;
  config.rays_per_step = 512;
  return config;
}

std::vector<float> RawOnGrid(const FieldSnapshot& snapshot, float reach) {
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3f unit(i % 10 / 4.5f - 1, i / 10 % 10 / 4.5f - 1, i / 100 / 4.5f - 1);
    points.push_back(reach * unit.cwiseProduct(snapshot.box_half_extents));
  }
  std::vector<float> raw(points.size());
  snapshot.field->Sample(points, raw, {});
  return raw;
}

double BallSurfaceError(const BallScene& scene, const FieldSnapshot& snapshot) {
  constexpr int kDirections = 300, kSteps = 80;
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  double sum = 0;
  for (int i = 0; i < kDirections; ++i) {
    const double z = 1 - (2.0 * i + 1) / kDirections, r = std::sqrt(1 - z * z);
    const Eigen::Vector3f direction =
        Eigen::Vector3d(r * std::cos(golden * i), r * std::sin(golden * i), z).cast<float>();
    std::vector<Eigen::Vector3f> points;
    for (int s = 0; s < kSteps; ++s) {
      points.push_back(direction * static_cast<float>(scene.radius_mu * 1.2 * (1 - static_cast<double>(s) / kSteps)));
    }
    std::vector<float> raw(points.size());
    snapshot.field->Sample(points, raw, {});
    double error = 1;
    for (size_t s = 0; s < points.size() && error == 1; ++s) {
      const Eigen::Vector3f unit = points[s].cwiseQuotient(snapshot.box_half_extents);
      if (unit.cwiseAbs().maxCoeff() >= 1) continue;
      const Eigen::Vector3i cell = ((unit.array() + 1) * 0.5f * snapshot.hull.resolution).cast<int>();
      const int index = (cell.z() * snapshot.hull.resolution + cell.y()) * snapshot.hull.resolution + cell.x();
      if (snapshot.hull.bits[static_cast<size_t>(index)] == 0 || raw[s] <= snapshot.surface_level) continue;
      error = std::abs(points[s].norm() / scene.radius_mu - 1);
    }
    sum += error;
  }
  return sum / kDirections;
}

}  // namespace romap::testing_support
