#include "server/slam/geometry/up_fusion.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

#include "common/angles.h"

namespace romap::slam::up_fusion_test {

Eigen::Vector3d Tilted(double x_deg, double y_deg = 0) {
  return Eigen::AngleAxisd(x_deg * kRadPerDeg, Eigen::Vector3d::UnitX()) *
         (Eigen::AngleAxisd(y_deg * kRadPerDeg, Eigen::Vector3d::UnitY()) * Eigen::Vector3d::UnitZ());
}

UpClue Direction(const Eigen::Vector3d& up, double sigma_deg, double reliability) {
  return {.vector_world = up, .sigma_rad = sigma_deg * kRadPerDeg, .reliability = reliability};
}

UpClue Wall(const Eigen::Vector3d& normal, double sigma_deg, double reliability) {
  return {.kind = UpClue::Kind::kPerpendicular,
          .vector_world = normal,
          .sigma_rad = sigma_deg * kRadPerDeg,
          .reliability = reliability};
}

double Error_deg(const FusedUp& up, const Eigen::Vector3d& truth) {
  return std::atan2(up.direction_world.cross(truth).norm(), up.direction_world.dot(truth)) / kRadPerDeg;
}

// The cameras look down, so the mean of their own up axes is far from up.
const Eigen::Vector3d kGuess = Tilted(35, 10);

TEST(UpFusion, OneClueIsAsReliableAsItSays) {
  const std::vector<UpClue> clues = {Direction(Tilted(3), 0.5, 0.6)};
  const FusedUp up = FuseUp(clues, kGuess);
  EXPECT_LT(Error_deg(up, Tilted(3)), 0.05);
  EXPECT_NEAR(up.confidence, 0.6, 0.02);
  EXPECT_NEAR(up.sigma_rad / kRadPerDeg, 0.5, 0.01);
}

TEST(UpFusion, CluesThatAgreeConfirmEachOther) {
  const std::vector<UpClue> clues = {Direction(Tilted(1), 0.5, 0.4), Direction(Tilted(0, 1), 2, 0.5)};
  const FusedUp up = FuseUp(clues, kGuess);
  EXPECT_GT(up.confidence, 0.95);
  EXPECT_LT(Error_deg(up, Tilted(1)), 0.2);
  EXPECT_LT(up.sigma_rad, 0.5 * kRadPerDeg);
}

TEST(UpFusion, TheMoreReliableOfTwoContradictoryCluesWins) {
  const std::vector<UpClue> clues = {Direction(Tilted(30), 0.5, 0.4), Direction(Tilted(0, 1), 2, 0.8)};
  const FusedUp up = FuseUp(clues, kGuess);
  EXPECT_LT(Error_deg(up, Tilted(0, 1)), 0.2);
  EXPECT_LT(up.confidence, 0.8);
  EXPECT_GT(up.confidence, 0.5);
  const std::vector<UpClue> doubtful = {Direction(Tilted(30), 0.5, 0.8), Direction(Tilted(0, 1), 2, 0.8)};
  EXPECT_LT(FuseUp(doubtful, kGuess).confidence, 0.5);
}

TEST(UpFusion, WallsDecideBetweenContradictoryClues) {
  const std::vector<UpClue> clues = {Direction(Tilted(30), 0.5, 0.8), Direction(Tilted(0, 1), 2, 0.8),
                                     Wall(Eigen::Vector3d::UnitY(), 0.5, 0.7)};
  const FusedUp up = FuseUp(clues, kGuess);
  EXPECT_LT(std::abs(up.direction_world.y()), std::sin(0.5 * kRadPerDeg));
  EXPECT_GT(up.confidence, 0.9);
}

TEST(UpFusion, TwoWallsShowUpAndOneDoesNot) {
  const std::vector<UpClue> walls = {Wall(Eigen::Vector3d::UnitY(), 0.5, 0.9),
                                     Wall(Eigen::Vector3d::UnitX(), 0.5, 0.9)};
  const FusedUp up = FuseUp(walls, kGuess);
  EXPECT_LT(Error_deg(up, Eigen::Vector3d::UnitZ()), 0.1);
  EXPECT_GT(up.confidence, 0.7);
  EXPECT_EQ(FuseUp(std::span(walls).first(1), kGuess).confidence, 0);
  EXPECT_EQ(FuseUp({}, kGuess).confidence, 0);
}

}  // namespace romap::slam::up_fusion_test
