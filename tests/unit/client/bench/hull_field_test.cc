#include "client/bench/hull_field.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "server/mesh/extract_mesh.h"

namespace romap {
namespace {

constexpr double kRadius_mu = 0.5, kDistance_mu = 3;
constexpr int kSide_px = 200;
constexpr double kFocal_px = 400;

// A ball at the origin seen from all around, as far as its mask goes.
std::vector<ObjectView> BallViews() {
  std::vector<ObjectView> views;
  for (int i = 0; i < 18; ++i) {
    const double azimuth = 2 * std::numbers::pi * i / 18, elevation = (i % 3 - 1) * 0.9;
    const Eigen::Vector3d toward(std::cos(azimuth) * std::cos(elevation), std::sin(azimuth) * std::cos(elevation),
                                 std::sin(elevation));
    const Eigen::Vector3d right = (-toward).cross(Eigen::Vector3d::UnitZ()).normalized();
    Eigen::Matrix3d axes;
    axes << right, (-toward).cross(right), -toward;
    ObjectView view;
    view.object = ObjectId{4};
    view.keyframe = KeyframeId{static_cast<uint64_t>(i + 1)};
    view.camera = {.width_px = kSide_px,
                   .height_px = kSide_px,
                   .fx_px = kFocal_px,
                   .fy_px = kFocal_px,
                   .cx_px = kSide_px / 2,
                   .cy_px = kSide_px / 2};
    view.T_world_camera = SE3<World, Camera>(axes, kDistance_mu * toward);
    view.roi_px = cv::Rect(0, 0, kSide_px, kSide_px);
    view.color_bgr = cv::Mat(kSide_px, kSide_px, CV_8UC3, cv::Scalar::all(128));
    view.ray_kind = cv::Mat(kSide_px, kSide_px, CV_8UC1, cv::Scalar(static_cast<int>(RayKind::kBackground)));
    const double radius_px = kFocal_px * std::tan(std::asin(kRadius_mu / kDistance_mu));
    cv::circle(view.ray_kind, {kSide_px / 2, kSide_px / 2}, static_cast<int>(std::lround(radius_px)),
               cv::Scalar(static_cast<int>(RayKind::kObject)), cv::FILLED);
    views.push_back(std::move(view));
  }
  return views;
}

FieldSnapshot BallHull() {
  NerfConfig config;
  config.hull_margin = 0;
  const Eigen::AngleAxisd turn(0.4, Eigen::Vector3d::UnitZ());
  const Cuboid cuboid{SE3<World, Object>(Eigen::Quaterniond(turn), Eigen::Vector3d::Zero()),
                      Eigen::Vector3d(kRadius_mu, kRadius_mu, 1.2 * kRadius_mu), 1.0};
  return MakeHullSnapshot(config, cuboid, BallViews());
}

float RawAt(const FieldSnapshot& snapshot, const Eigen::Vector3f& p_object) {
  const std::vector<Eigen::Vector3f> points = {p_object};
  std::vector<float> raw(1);
  std::vector<Rgb8> rgb(1);
  snapshot.field->Sample(points, raw, rgb);
  return raw[0];
}

TEST(HullFieldTest, IsFullInsideAndEmptyOutside) {
  const FieldSnapshot snapshot = BallHull();
  EXPECT_EQ(snapshot.object.value, 4u);
  EXPECT_EQ(snapshot.view_centers_object.size(), 18u);
  EXPECT_FLOAT_EQ(RawAt(snapshot, {0, 0, 0}), 10);
  EXPECT_FLOAT_EQ(RawAt(snapshot, {0.45f, 0.45f, 0.5f}), -10);
  EXPECT_EQ(RawAt(snapshot, {0.7f, 0, 0}), -1e4f);
  EXPECT_GT(RawAt(snapshot, {0, 0.44f, 0}), 0);
  EXPECT_GT(RawAt(snapshot, {0, 0, -0.44f}), 0);
  EXPECT_LT(RawAt(snapshot, {0, 0, -0.62f}), 0);
}

TEST(HullFieldTest, ValuesRunEvenlyBetweenCells) {
  const FieldSnapshot snapshot = BallHull();
  const float cell = 2 * snapshot.box_half_extents.x() / 64;
  float before = RawAt(snapshot, {0, 0, 0});
  int between = 0;
  for (float x = 0; x < snapshot.box_half_extents.x(); x += cell / 8) {
    const float raw = RawAt(snapshot, {x, 0.01f, 0.01f});
    EXPECT_LE(std::fabs(raw - before), 20.0f / 8 + 0.1f) << "at " << x;
    between += raw > -9.9f && raw < 9.9f;
    before = raw;
  }
  EXPECT_GE(between, 5);
}

// The hull of a ball is a little larger than the ball, never smaller; the surface of the snapshot is that of the hull.
TEST(HullFieldTest, ItsSurfaceHugsTheBall) {
  const absl::StatusOr<Mesh> mesh = ExtractMesh(BallHull(), MeshConfig());
  ASSERT_TRUE(mesh.ok());
  ASSERT_GT(mesh->vertices.size(), 500u);
  double sum = 0;
  for (const Eigen::Vector3f& v : mesh->vertices) sum += v.norm();
  EXPECT_NEAR(sum / static_cast<double>(mesh->vertices.size()), kRadius_mu, 0.06 * kRadius_mu);
}

}  // namespace
}  // namespace romap
