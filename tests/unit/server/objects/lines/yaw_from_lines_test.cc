#include "server/objects/lines/yaw_from_lines.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "common/angles.h"
#include "common/geometry.h"

namespace romap::objects::yaw_from_lines_test {

constexpr double kPi = std::numbers::pi;

CameraModel TestCamera() {
  return {.width_px = 640, .height_px = 480, .fx_px = 520, .fy_px = 520, .cx_px = 319.5, .cy_px = 239.5};
}

// A camera that looks at the origin from `distance` map units.
SE3<World, Camera> LookFrom(double azimuth_rad, double elevation_rad, double distance = 1.5) {
  const Eigen::Vector3d center =
      distance * Eigen::Vector3d(std::cos(azimuth_rad) * std::cos(elevation_rad),
                                 std::sin(azimuth_rad) * std::cos(elevation_rad), std::sin(elevation_rad));
  Eigen::Matrix3d R_world_camera;
  R_world_camera.col(2) = -center.normalized();
  R_world_camera.col(0) = R_world_camera.col(2).cross(Eigen::Vector3d::UnitZ()).normalized();
  R_world_camera.col(1) = R_world_camera.col(2).cross(R_world_camera.col(0));
  return {R_world_camera, center};
}

// Cameras, and the segments that each sees of an object at the origin.
class Scene {
 public:
  explicit Scene(double noise_px = 0.5) : noise_px_(noise_px) {}

  void AddCamera(double azimuth_rad, double elevation_rad) {
    T_world_camera_.push_back(LookFrom(azimuth_rad, elevation_rad));
    segments_.emplace_back();
  }
  void AddRing(int count, double from_rad, double to_rad, double elevation_rad = 0.6) {
    for (int i = 0; i < count; ++i) AddCamera(from_rad + (to_rad - from_rad) * i / count, elevation_rad);
  }
  size_t cameras() const { return T_world_camera_.size(); }
  Eigen::Vector3d CameraCenter(size_t view) const { return T_world_camera_[view].translation(); }

  // An edge in space, projected into one camera.
  void AddEdge(size_t view, const Eigen::Vector3d& a_world, const Eigen::Vector3d& b_world) {
    AddSegment(view, Project(view, a_world), Project(view, b_world));
  }
  void AddSegment(size_t view, const Eigen::Vector2d& a_px, const Eigen::Vector2d& b_px) {
    segments_[view].push_back({Noisy(a_px), Noisy(b_px)});
  }
  // The twelve edges of a cuboid in every view, without occlusion.
  void AddCuboid(double yaw_rad, const Eigen::Vector3d& half_extents) {
    const Eigen::AngleAxisd turn(yaw_rad, Eigen::Vector3d::UnitZ());
    for (size_t view = 0; view < cameras(); ++view) {
      for (int axis = 0; axis < 3; ++axis) {
        for (int side = 0; side < 4; ++side) {
          Eigen::Vector3d from = half_extents;
          from[(axis + 1) % 3] *= (side & 1) != 0 ? 1 : -1;
          from[(axis + 2) % 3] *= (side & 2) != 0 ? 1 : -1;
          Eigen::Vector3d to = from;
          to[axis] *= -1;
          AddEdge(view, turn * from, turn * to);
        }
      }
    }
  }
  // The upper and lower rim of an upright truncated cone as chords, and the two sides of its outline, in every view.
  void AddRound(double bottom_radius, double top_radius, double height) {
    constexpr int kChords = 18;
    for (size_t view = 0; view < cameras(); ++view) {
      for (int i = 0; i < kChords; ++i) {
        const double a = 2 * kPi * (i + 0.5) / kChords;
        const double b = 2 * kPi * (i + 1.5) / kChords;
        // A detector finds straight segments only where the curvature of the rim's ellipse is low.
        const Eigen::Vector2d look = CameraCenter(view).head<2>().normalized();
        const double across = std::abs(look.dot(Eigen::Vector2d(std::cos((a + b) / 2), std::sin((a + b) / 2))));
        if (across < 0.97) continue;
        for (const auto& [radius, z] : {std::pair(bottom_radius, -height / 2), std::pair(top_radius, height / 2)}) {
          AddEdge(view, {radius * std::cos(a), radius * std::sin(a), z},
                  {radius * std::cos(b), radius * std::sin(b), z});
        }
      }
      for (const double side : {-1.0, 1.0}) {
        const Eigen::Vector2d look = CameraCenter(view).head<2>().normalized();
        const Eigen::Vector2d outward = side * Eigen::Vector2d(-look.y(), look.x());
        const Eigen::Vector2d low = bottom_radius * outward;
        const Eigen::Vector2d high = top_radius * outward;
        AddEdge(view, {low.x(), low.y(), -height / 2}, {high.x(), high.y(), height / 2});
      }
    }
  }
  void AddClutter(int per_view) {
    std::uniform_real_distribution<double> place_px(-70, 70);
    std::uniform_real_distribution<double> angle(0, kPi);
    std::uniform_real_distribution<double> half_length_px(6, 30);
    for (size_t view = 0; view < cameras(); ++view) {
      for (int i = 0; i < per_view; ++i) {
        const Eigen::Vector2d middle(320 + place_px(random_), 240 + place_px(random_));
        const double a = angle(random_);
        const Eigen::Vector2d half = half_length_px(random_) * Eigen::Vector2d(std::cos(a), std::sin(a));
        AddSegment(view, middle - half, middle + half);
      }
    }
  }

  std::vector<LineView> Views() const {
    std::vector<LineView> views;
    for (size_t i = 0; i < cameras(); ++i) {
      views.push_back({TestCamera(), T_world_camera_[i].RotationMatrix(), segments_[i]});
    }
    return views;
  }
  std::optional<YawEstimate> Yaw(const Eigen::Matrix3d& R_world_reference = Eigen::Matrix3d::Identity()) const {
    return YawFromLines(R_world_reference, Views());
  }

 private:
  Eigen::Vector2d Project(size_t view, const Eigen::Vector3d& p_world) const {
    return TestCamera().Project(T_world_camera_[view].Inverse() * p_world);
  }
  Eigen::Vector2d Noisy(const Eigen::Vector2d& p_px) {
    const double u = normal_(random_);
    return p_px + noise_px_ * Eigen::Vector2d(u, normal_(random_));
  }

  std::mt19937 random_{5};
  std::normal_distribution<double> normal_;
  const double noise_px_;  // standard deviation; may be 0
  std::vector<SE3<World, Camera>> T_world_camera_;
  std::vector<std::vector<LineSegment>> segments_;
};

const Eigen::Vector3d kBox(0.15, 0.1, 0.06);

class BoxYawTest : public ::testing::TestWithParam<double> {};

TEST_P(BoxYawTest, IsRobustToClutter) {
  Scene scene;
  scene.AddRing(20, 0, 2 * kPi);
  scene.AddCuboid(GetParam(), kBox);
  scene.AddClutter(15);
  const auto yaw = scene.Yaw();
  ASSERT_TRUE(yaw.has_value());
  EXPECT_LT(std::abs(std::remainder(yaw->yaw_rad - GetParam(), kPi / 2)), 0.5 * kRadPerDeg);
  EXPECT_LE(std::abs(yaw->yaw_rad), kPi / 4 + 1e-9);
  EXPECT_GT(yaw->confidence, 0.25);
}

TEST_P(BoxYawTest, IsFoundFromViewsOfOneSide) {
  Scene scene;
  scene.AddRing(6, 0.3, 0.9);
  scene.AddCuboid(GetParam(), kBox);
  const auto yaw = scene.Yaw();
  ASSERT_TRUE(yaw.has_value());
  EXPECT_LT(std::abs(std::remainder(yaw->yaw_rad - GetParam(), kPi / 2)), 1 * kRadPerDeg);
  EXPECT_GT(yaw->confidence, 0.25);
}

TEST_P(BoxYawTest, IsRelativeToTheReference) {
  Scene scene;
  scene.AddRing(12, 0, 2 * kPi);
  scene.AddCuboid(GetParam(), kBox);
  const auto plain = scene.Yaw();
  const double turn_rad = 0.3;
  const auto turned = scene.Yaw(Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix());
  ASSERT_TRUE(plain && turned);
  EXPECT_NEAR(std::remainder(plain->yaw_rad - turn_rad - turned->yaw_rad, kPi / 2), 0, 1e-4);
  EXPECT_NEAR(plain->confidence, turned->confidence, 0.05);
}

TEST_P(BoxYawTest, IsRobustToATiltedUp) {
  Scene scene;
  scene.AddRing(20, 0, 2 * kPi);
  scene.AddCuboid(GetParam(), kBox);
  for (const Eigen::Vector3d& axis : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1, 0)}) {
    const auto yaw = scene.Yaw(Eigen::AngleAxisd(2 * kRadPerDeg, axis).toRotationMatrix());
    ASSERT_TRUE(yaw.has_value());
    EXPECT_LT(std::abs(std::remainder(yaw->yaw_rad - GetParam(), kPi / 2)), 1 * kRadPerDeg);
    EXPECT_GT(yaw->confidence, 0.25);
  }
}

INSTANTIATE_TEST_SUITE_P(Yaws, BoxYawTest, ::testing::Values(-1.4, -0.7, -0.2, 0.0, 0.35, 0.78, 1.1));

TEST(YawFromLinesTest, LowConfidenceForRoundObjects) {
  for (const double end_rad : {2 * kPi, kPi / 2, kPi / 6, kPi / 18}) {
    for (const double top_radius : {0.2, 0.26}) {
      Scene scene;
      scene.AddRing(12, 0, end_rad);
      scene.AddRound(0.2, top_radius, 0.2);
      const auto yaw = scene.Yaw();
      ASSERT_TRUE(yaw.has_value());
      EXPECT_LT(yaw->confidence, 0.15) << "ring of " << end_rad << " rad, top radius " << top_radius;
    }
  }
}

TEST(YawFromLinesTest, LowConfidenceForClutter) {
  Scene scene;
  scene.AddRing(12, 0, 2 * kPi);
  scene.AddClutter(20);
  const auto yaw = scene.Yaw();
  ASSERT_TRUE(yaw.has_value());
  EXPECT_LT(yaw->confidence, 0.1);
}

TEST(YawFromLinesTest, LowConfidenceForTwoObjectsWithDifferentYaws) {
  Scene scene;
  scene.AddRing(12, 0, 2 * kPi);
  scene.AddCuboid(0, kBox);
  scene.AddCuboid(0.6, kBox);
  const auto yaw = scene.Yaw();
  ASSERT_TRUE(yaw.has_value());
  EXPECT_LT(yaw->confidence, 0.15);
}

TEST(YawFromLinesTest, LowConfidenceForOneEdge) {
  Scene scene;
  scene.AddCamera(0.4, 0.6);
  scene.AddEdge(0, {-0.1, 0, 0}, {0.1, 0, 0});
  const auto yaw = scene.Yaw();
  ASSERT_TRUE(yaw.has_value());
  EXPECT_NEAR(yaw->yaw_rad, 0, 2 * kRadPerDeg);
  EXPECT_LT(yaw->confidence, 0.2);
}

TEST(YawFromLinesTest, IgnoresVerticalEdges) {
  Scene scene;
  scene.AddRing(10, 0, 2 * kPi);
  for (size_t view = 0; view < scene.cameras(); ++view) {
    scene.AddEdge(view, {0.1, 0.05, -0.1}, {0.1, 0.05, 0.1});
    scene.AddEdge(view, {-0.1, 0.05, -0.1}, {-0.1, 0.05, 0.1});
  }
  EXPECT_FALSE(scene.Yaw().has_value());
}

TEST(YawFromLinesTest, IgnoresEdgesAtTheHeightOfTheCamera) {
  Scene scene(0);
  scene.AddCamera(0, 0);
  scene.AddEdge(0, {0.1, -0.1, 0}, {-0.2, 0.1, 0});
  EXPECT_FALSE(scene.Yaw().has_value());
}

TEST(YawFromLinesTest, ReturnsNothingWithoutSegments) {
  EXPECT_FALSE(YawFromLines(Eigen::Matrix3d::Identity(), {}).has_value());
  Scene scene(0);
  scene.AddCamera(0, 0.5);
  EXPECT_FALSE(scene.Yaw().has_value());
  scene.AddSegment(0, {100, 100}, {100, 100});  // a segment without length
  EXPECT_FALSE(scene.Yaw().has_value());
}

TEST(YawFromLinesTest, IsExactWithoutNoise) {
  Scene scene(0);
  scene.AddRing(8, 0, 2 * kPi);
  scene.AddCuboid(0.123456, kBox);
  const auto yaw = scene.Yaw();
  ASSERT_TRUE(yaw.has_value());
  EXPECT_NEAR(yaw->yaw_rad, 0.123456, 1e-6);
}

}  // namespace romap::objects::yaw_from_lines_test
