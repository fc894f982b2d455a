#include "server/slam/geometry/level_cameras.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "common/angles.h"

namespace romap::slam::level_cameras_test {

struct CameraArc {
  double arc_deg = 150;
  double pitch_deg = 35;  // downward
  double constant_roll_deg = 0;
  double sway_deg = 3;  // of the roll, standard deviation
  uint64_t seed = 1;
};

// Cameras on an arc around the origin of a world in which up is an arbitrary direction.
class CamerasOnArc {
 public:
  explicit CamerasOnArc(const CameraArc& arc) {
    std::mt19937_64 random(arc.seed);
    std::normal_distribution<double> normal;
    const Eigen::Quaterniond turn =
        Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random)).normalized();
    up = turn * Eigen::Vector3d::UnitZ();
    constexpr int kCameras = 40;
    for (int i = 0; i < kCameras; ++i) {
      const double azimuth = arc.arc_deg * kRadPerDeg * i / kCameras;
      const double roll = (arc.constant_roll_deg + arc.sway_deg * normal(random)) * kRadPerDeg;
      const Eigen::Vector3d forward(-std::cos(azimuth) * std::cos(arc.pitch_deg * kRadPerDeg),
                                    -std::sin(azimuth) * std::cos(arc.pitch_deg * kRadPerDeg),
                                    -std::sin(arc.pitch_deg * kRadPerDeg));
      const Eigen::Vector3d level = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
      const Eigen::Quaterniond rolled = turn * Eigen::Quaterniond(Eigen::AngleAxisd(roll, forward));
      rights.push_back(rolled * level);
      ups.push_back(rolled * level.cross(forward));
    }
  }

  double Error_rad(const LevelUp& level) const {
    return std::atan2(level.up_world.cross(up).norm(), level.up_world.dot(up));
  }

  Eigen::Vector3d up;
  std::vector<Eigen::Vector3d> rights;
  std::vector<Eigen::Vector3d> ups;
};

TEST(LevelCameras, ErrorsAgreeWithTheStandardDeviation) {
  for (const double arc_deg : {60.0, 150.0, 360.0}) {
    SCOPED_TRACE(arc_deg);
    double squared_error = 0;
    double squared_sigma = 0;
    for (uint64_t seed = 1; seed <= 20; ++seed) {
      const CamerasOnArc cameras({.arc_deg = arc_deg, .seed = seed});
      const auto level = UpFromLevelCameras(cameras.rights, cameras.ups);
      ASSERT_TRUE(level.has_value());
      squared_error += std::pow(cameras.Error_rad(*level), 2);
      squared_sigma += 2 * std::pow(level->sigma_rad, 2);
    }
    EXPECT_LT(std::sqrt(squared_error), 1.5 * std::sqrt(squared_sigma));
    EXPECT_LT(std::sqrt(squared_error / 20), 2.5 * kRadPerDeg);
  }
}

// Only cameras in all directions separate a constant roll from up.
TEST(LevelCameras, AConstantRollDoesNotTiltUpAfterAFullCircle) {
  const CamerasOnArc circle({.arc_deg = 360, .constant_roll_deg = 6, .sway_deg = 1});
  const auto around = UpFromLevelCameras(circle.rights, circle.ups);
  ASSERT_TRUE(around.has_value());
  EXPECT_LT(circle.Error_rad(*around), 1 * kRadPerDeg);
  const CamerasOnArc arc({.arc_deg = 100, .constant_roll_deg = 4, .sway_deg = 1});
  const auto aside = UpFromLevelCameras(arc.rights, arc.ups);
  ASSERT_TRUE(aside.has_value());
  EXPECT_LT(arc.Error_rad(*aside), 3 * std::numbers::sqrt2 * aside->sigma_rad);
  EXPECT_GT(aside->sigma_rad, around->sigma_rad);
}

TEST(LevelCameras, NothingFollowsFromCamerasThatAreNotLevel) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    const CamerasOnArc rotating({.sway_deg = 40, .seed = seed});
    EXPECT_FALSE(UpFromLevelCameras(rotating.rights, rotating.ups).has_value());
    for (const double arc_deg : {20.0, 60.0, 150.0, 360.0}) {
      SCOPED_TRACE(arc_deg);
      const CamerasOnArc portrait({.arc_deg = arc_deg, .constant_roll_deg = 90, .seed = seed});
      EXPECT_FALSE(UpFromLevelCameras(portrait.rights, portrait.ups).has_value());
    }
  }
}

TEST(LevelCameras, NothingFollowsFromOneDirection) {
  const CamerasOnArc still({.arc_deg = 1, .sway_deg = 0.1});
  EXPECT_FALSE(UpFromLevelCameras(still.rights, still.ups).has_value());
  EXPECT_FALSE(UpFromLevelCameras({}, {}).has_value());
}

}  // namespace romap::slam::level_cameras_test
