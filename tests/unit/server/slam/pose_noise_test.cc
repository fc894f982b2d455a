#include "server/slam/pose_noise.h"

#include <gtest/gtest.h>

#include <random>

#include "server/slam/optimize/lie.h"

namespace romap::slam::pose_noise_test {

CameraModel TestCamera() {
  return {.width_px = 640, .height_px = 480, .fx_px = 525, .fy_px = 525, .cx_px = 319.5, .cy_px = 239.5};
}

SE3<Camera, Camera> MotionToTheSide() { return {ExpRotation({0, 0.1, 0}), Eigen::Vector3d(-0.3, 0, 0.02)}; }

// Around the points, seen from 35 degrees above.
SE3<Camera, Camera> MotionAround() {
  const Eigen::Quaterniond rotation = ExpRotation(0.25 * Eigen::Vector3d(0, 0.82, 0.57));
  const Eigen::Vector3d center(0, 0, 2.5);
  return {rotation, center - rotation * center};
}

// Matches of random points with half a pixel of noise, for a motion. The stated motion is turned by
// `error_rad` about the axis that moves the image across it.
PoseCheck::AgreeingPair MakePair(double error_rad, std::mt19937& random,
                                 const SE3<Camera, Camera>& T_second_first = MotionToTheSide()) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> noise(0, 0.5);
  PoseCheck::AgreeingPair pair;
  while (pair.matches.size() < 150) {
    const Eigen::Vector3d p_first(uniform(random), 0.7 * uniform(random), 2.5 + uniform(random));
    const Eigen::Vector3d p_second = T_second_first * p_first;
    const Eigen::Vector2d first = TestCamera().Project(p_first);
    const Eigen::Vector2d second = TestCamera().Project(p_second);
    const Eigen::Vector2d error(noise(random), noise(random));
    pair.matches.push_back({first, second + error, 1.0});
  }
  pair.T_second_first = {ExpRotation({error_rad, 0, 0}) * T_second_first.rotation(), T_second_first.translation()};
  return pair;
}

std::optional<Diagnostic> CheckWith(double error_rad, int pairs) {
  std::mt19937 random(1);
  PoseNoise noise{SlamConfig{}};
  for (int i = 0; i < pairs; ++i) noise.AddPair(TestCamera(), MakePair((i % 2 == 0 ? 1 : -1) * error_rad, random));
  return noise.Check();
}

TEST(PoseNoiseTest, ExactPosesGiveNoWarning) { EXPECT_FALSE(CheckWith(0, 30).has_value()); }

TEST(PoseNoiseTest, SmallErrorsGiveNoWarning) { EXPECT_FALSE(CheckWith(0.001, 30).has_value()); }

TEST(PoseNoiseTest, LargeErrorsAreStatedInPixels) {
  const std::optional<Diagnostic> diagnostic = CheckWith(0.01, 30);
  ASSERT_TRUE(diagnostic.has_value());
  EXPECT_EQ(diagnostic->code, "poses_inexact");
  EXPECT_EQ(diagnostic->severity, Severity::kWarning);
}

// Near and far points are exchanged by turning the images, so that the poses seem to be inexact only.
PoseNoise NoiseOfTurnedImages(int pairs) {
  std::mt19937 random(1);
  PoseNoise noise{SlamConfig{}};
  for (int i = 0; i < pairs; ++i) {
    PoseCheck::AgreeingPair pair = MakePair(0, random, MotionAround());
    for (TwoViewMatch& match : pair.matches) {
      match.first_px = Eigen::Vector2d(639, 479) - match.first_px;
      match.second_px = Eigen::Vector2d(639, 479) - match.second_px;
    }
    noise.AddPair(TestCamera(), pair);
  }
  return noise;
}

TEST(PoseNoiseTest, NamesTurnedImages) {
  const PoseNoise noise = NoiseOfTurnedImages(30);
  ASSERT_TRUE(noise.ImagesAreFlipped());
  EXPECT_EQ(noise.Check()->code, "poses_contradict_images");
  EXPECT_EQ(noise.Check()->severity, Severity::kError);
  EXPECT_NE(noise.Check()->text.find("turned by 180 degrees"), std::string::npos) << noise.Check()->text;
  EXPECT_FALSE(NoiseOfTurnedImages(5).ImagesAreFlipped());
}

TEST(PoseNoiseTest, InexactPosesAreNoFlippedImages) {
  std::mt19937 random(1);
  PoseNoise noise{SlamConfig{}};
  for (int i = 0; i < 30; ++i) noise.AddPair(TestCamera(), MakePair(i % 2 == 0 ? 0.01 : -0.01, random));
  EXPECT_FALSE(noise.ImagesAreFlipped());
}

TEST(PoseNoiseTest, AFewPairsAreNotJudged) { EXPECT_FALSE(CheckWith(0.01, 5).has_value()); }

}  // namespace romap::slam::pose_noise_test
