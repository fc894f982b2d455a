#include "server/slam/geometry/world_alignment.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "common/angles.h"
#include "tests/unit/server/slam/geometry/synthetic_scene.h"

namespace romap::slam::world_alignment_test {

const Sim3<World, World> kGivenFromMap(2.5, RotationXyz(20, -50, 110), {3, -1, 0.5});

struct PathNoise {
  double position_mu = 0;  // of the given poses, per axis
  double rotation_rad = 0;
  int wrong = 0;  // pairs with a random pose, the first ones
};

// Cameras on an arc, or on a line along x, with one meter from end to end in the map.
std::vector<TwoWorldPose> MakePairs(int count, bool is_line, const PathNoise& path_noise, uint64_t seed) {
  Noise noise(seed);
  std::vector<TwoWorldPose> pairs;
  for (int i = 0; i < count; ++i) {
    const double share = static_cast<double>(i) / (count - 1);
    const Eigen::Vector3d center(share, is_line ? 0 : std::sin(2 * share), 0);
    TwoWorldPose pair;
    pair.T_map_camera = {RotationXyz(90, 40 * share, 0), center};
    pair.T_given_camera = kGivenFromMap.Moved(pair.T_map_camera);
    const Eigen::Vector3d turn_rad = noise.Normal3(path_noise.rotation_rad);
    const Eigen::Quaterniond turn(
        Eigen::AngleAxisd(turn_rad.norm(), (turn_rad + Eigen::Vector3d(0, 0, 1e-12)).normalized()));
    pair.T_given_camera = {pair.T_given_camera.rotation() * turn,
                           pair.T_given_camera.translation() + noise.Normal3(path_noise.position_mu)};
    if (i < path_noise.wrong) {
      pair.T_given_camera = {RotationXyz(noise.Uniform(0, 180), noise.Uniform(0, 90), 0), noise.Normal3(3)};
    }
    pairs.push_back(pair);
  }
  return pairs;
}

double AngleError_deg(const WorldAlignment& alignment) {
  return alignment.S_given_map.rotation().angularDistance(kGivenFromMap.rotation()) / kRadPerDeg;
}

TEST(AlignWorlds, FindsTheExactSimilarity) {
  for (const bool is_line : {false, true}) {
    const auto alignment = AlignWorlds(MakePairs(12, is_line, {}, 1), false);
    ASSERT_TRUE(alignment);
    EXPECT_NEAR(alignment->S_given_map.scale(), 2.5, 1e-6);
    EXPECT_LT(AngleError_deg(*alignment), 1e-4);
    EXPECT_LT((alignment->S_given_map.translation() - kGivenFromMap.translation()).norm(), 1e-5);
    EXPECT_EQ(alignment->agreeing_share, 1);
    EXPECT_LT(alignment->scale_sigma_ratio, 1e-6);
  }
}

TEST(AlignWorlds, ToleratesWrongPoses) {
  const auto alignment =
      AlignWorlds(MakePairs(30, false, {.position_mu = 0.01, .rotation_rad = 0.01, .wrong = 12}, 2), false);
  ASSERT_TRUE(alignment);
  EXPECT_NEAR(alignment->S_given_map.scale(), 2.5, 0.05);
  EXPECT_LT(AngleError_deg(*alignment), 1);
  EXPECT_NEAR(alignment->agreeing_share, 0.6, 0.05);
}

// The stated standard deviations must describe the errors over many noisy paths.
TEST(AlignWorlds, StatesItsUncertainty) {
  double scale_squares = 0, stated_squares = 0, angle_squares = 0, stated_angle_squares = 0;
  for (uint64_t seed = 1; seed <= 100; ++seed) {
    const auto alignment = AlignWorlds(MakePairs(20, false, {.position_mu = 0.1, .rotation_rad = 0.02}, seed), false);
    ASSERT_TRUE(alignment);
    scale_squares += std::pow(alignment->S_given_map.scale() / 2.5 - 1, 2);
    stated_squares += std::pow(alignment->scale_sigma_ratio, 2);
    angle_squares += std::pow(AngleError_deg(*alignment) * kRadPerDeg, 2) / 3;  // per axis
    stated_angle_squares += std::pow(alignment->alignment_sigma_rad, 2);
  }
  EXPECT_NEAR(std::sqrt(stated_squares / scale_squares), 1, 0.5);
  EXPECT_NEAR(std::sqrt(stated_angle_squares / angle_squares), 1, 0.5);
}

TEST(AlignWorlds, UnrelatedPathsDoNotAgree) {
  std::vector<TwoWorldPose> pairs = MakePairs(20, false, {}, 3);
  Noise noise(4);
  for (TwoWorldPose& pair : pairs) {
    pair.T_given_camera = {RotationXyz(noise.Uniform(0, 360), noise.Uniform(0, 90), noise.Uniform(0, 90)),
                           noise.Normal3(1)};
  }
  const auto alignment = AlignWorlds(pairs, false);
  EXPECT_TRUE(!alignment || alignment->rotation_sigma_rad > 0.2);
}

TEST(AlignWorlds, KeepsTheScaleOfMetricMaps) {
  const auto alignment = AlignWorlds(MakePairs(12, false, {}, 1), true);
  ASSERT_TRUE(alignment);
  EXPECT_EQ(alignment->S_given_map.scale(), 1);
  EXPECT_GT(alignment->position_sigma_mu, 0.2) << "the given path is 2.5 times as long";
}

TEST(AlignWorlds, NeedsSeveralPosesAndMotion) {
  EXPECT_FALSE(AlignWorlds(MakePairs(2, false, {}, 1), false));
  std::vector<TwoWorldPose> pairs = MakePairs(12, false, {}, 1);
  for (TwoWorldPose& pair : pairs) pair.T_map_camera = pairs[0].T_map_camera;
  EXPECT_FALSE(AlignWorlds(pairs, false));
}

}  // namespace romap::slam::world_alignment_test
