#include "server/slam/world_up.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "common/angles.h"
#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam::world_up_test {

// A thin book on a table, seen from all sides: few points of the table are on one side of the book, and many points
// of the book's edge on the other.
class WorldUpTest : public ::testing::Test {
 protected:
  static constexpr double kThickness_mu = 0.012;

  WorldUpTest() {
    std::uniform_real_distribution<double> share(0, 1);
    for (int i = 0; i < 150; ++i) points_.emplace_back(-0.6 + 0.55 * share(random_), -0.6 + 1.2 * share(random_), 0);
    for (int i = 0; i < 300; ++i) points_.emplace_back(0.5, -0.2 + 0.4 * share(random_), kThickness_mu);
    for (int i = 0; i < 60; ++i) {
      points_.emplace_back(0.16 + 0.28 * share(random_), -0.14 + 0.28 * share(random_), kThickness_mu);
    }
    for (int i = 0; i < 12; ++i) AddKeyframe(i);
  }

  void AddKeyframe(int i) {
    const SE3<World, Camera> T_world_camera = TexturedWorld::OrbitPose(30.0 * i);
    Frame frame;
    frame.frame_id = static_cast<uint64_t>(i + 1);
    frame.camera = camera_;
    std::vector<cv::Point> outline_px;
    for (const auto& [x, y] : {std::pair{0.1, -0.2}, {0.5, -0.2}, {0.5, 0.2}, {0.1, 0.2}}) {
      const Eigen::Vector2d pixel_px = camera_.Project(T_world_camera.Inverse() * Eigen::Vector3d(x, y, kThickness_mu));
      outline_px.emplace_back(cvRound(pixel_px.x()), cvRound(pixel_px.y()));
    }
    cv::Mat book(camera_.height_px, camera_.width_px, CV_16UC1, cv::Scalar(0));
    cv::fillConvexPoly(book, outline_px, cv::Scalar(1));
    masks_.push_back({.frame_id = frame.frame_id, .labels = book, .instances = {}});
    std::vector<Feature> features(points_.size());
    for (size_t k = 0; k < points_.size(); ++k) {
      features[k].pixel_px = camera_.Project(T_world_camera.Inverse() * points_[k]).cast<float>();
    }
    map_.AddKeyframe(MakeFrameFeatures(frame, features), T_world_camera);
  }

  // Rolls the cameras about their optical axes.
  void RollCameras() {
    for (auto& [id, keyframe] : map_.keyframes()) {
      const SE3<World, Camera>& T = keyframe.T_world_camera();
      const Eigen::Quaterniond roll(Eigen::AngleAxisd(roll_rad_, Eigen::Vector3d::UnitZ()));
      keyframe.SetPose({T.rotation() * roll, T.translation()});
    }
  }

  void AddPoints() {
    for (size_t k = 0; k < points_.size(); ++k) {
      PointTrack& track = map_.AddPoint(points_[k]);
      for (auto& [id, keyframe] : map_.keyframes()) map_.AddObservation(track, keyframe, static_cast<int>(k));
      map_.Refresh(track);
    }
  }

  void TakeMasks() {
    for (auto& [id, keyframe] : map_.keyframes()) {
      keyframe.frame = WithMasks(*keyframe.frame, masks_[id.value - 1].labels, SlamConfig{}.mask_erosion_px);
    }
  }

  double roll_rad_ = 0;
  const CameraModel camera_ = TexturedWorld(640, 480).camera();
  // Tilts the world by 10 degrees. Returns the angle between the true up and z after the rotation that `up` proposes;
  // infinite if it proposes none.
  double UpErrorAfterTilt_rad(WorldUp* up) {
    const Eigen::Quaterniond tilt(Eigen::AngleAxisd(10 * kRadPerDeg, Eigen::Vector3d(1, 1, 0).normalized()));
    map_.Transform({1.0, tilt, Eigen::Vector3d::Zero()});
    const auto R_new_old = up->ProposeRotation(map_);
    if (!R_new_old) return std::numeric_limits<double>::infinity();
    const Eigen::Vector3d up_new = *R_new_old * (tilt * Eigen::Vector3d::UnitZ());
    return std::acos(std::min(1.0, up_new.z()));
  }

  std::mt19937_64 random_{3};
  std::vector<Eigen::Vector3d> points_;
  std::vector<FrameMasks> masks_;
  SlamMap map_{SlamConfig{}};
};

TEST_F(WorldUpTest, EdgesOfFlatObjectsDoNotTiltTheWorld) {
  AddPoints();
  TakeMasks();
  WorldUp up;
  EXPECT_LT(UpErrorAfterTilt_rad(&up), 0.2 * kRadPerDeg);
  EXPECT_TRUE(up.is_known());
  EXPECT_TRUE(up.Diagnostics().empty());
}

// Points without masks may lie on the objects, so only the cameras show up: all of them are level in this world.
TEST_F(WorldUpTest, LevelCamerasShowUpWithoutMasks) {
  AddPoints();
  WorldUp up;
  EXPECT_LT(UpErrorAfterTilt_rad(&up), 0.5 * kRadPerDeg);
  EXPECT_LT(up.confidence(), 0.9);
}

// Cameras on a mount roll, and nothing but the objects is visible.
TEST_F(WorldUpTest, UpIsUnknownWithoutEvidence) {
  roll_rad_ = 20 * kRadPerDeg;
  RollCameras();
  AddPoints();
  WorldUp up;
  EXPECT_FALSE(up.ProposeRotation(map_, /*is_last=*/true));
  EXPECT_FALSE(up.is_known());
  ASSERT_EQ(up.Diagnostics().size(), 1u);
  EXPECT_EQ(up.Diagnostics()[0].code, "up_unknown");
}

TEST_F(WorldUpTest, GravityShowsUpWithoutOtherEvidence) {
  roll_rad_ = 20 * kRadPerDeg;
  RollCameras();
  Frame frame;
  const SE3<World, Camera> T_world_camera = TexturedWorld::OrbitPose(0);
  frame.gravity_camera = T_world_camera.rotation().conjugate() * -Eigen::Vector3d::UnitZ();
  WorldUp up;
  up.ObserveGravity(frame, T_world_camera);
  const auto R_new_old = up.ProposeRotation(map_, /*is_last=*/true);
  ASSERT_TRUE(R_new_old);
  EXPECT_NEAR((*R_new_old * Eigen::Vector3d::UnitZ()).z(), 1, 1e-6);
  EXPECT_TRUE(up.is_known());
  EXPECT_TRUE(up.Diagnostics().empty());
}

TEST_F(WorldUpTest, SmallRotationsAreProposedOnlyAtTheEnd) {
  AddPoints();
  TakeMasks();
  const Eigen::Quaterniond tilt(Eigen::AngleAxisd(0.15 * kRadPerDeg, Eigen::Vector3d::UnitX()));
  map_.Transform({1.0, tilt, Eigen::Vector3d::Zero()});
  WorldUp up;
  EXPECT_FALSE(up.ProposeRotation(map_));
  const auto R_new_old = up.ProposeRotation(map_, /*is_last=*/true);
  ASSERT_TRUE(R_new_old);
  const Eigen::Vector3d up_new = *R_new_old * (tilt * Eigen::Vector3d::UnitZ());
  EXPECT_LT(std::acos(std::min(1.0, up_new.z())), 0.1 * kRadPerDeg);
}

}  // namespace romap::slam::world_up_test
