#include "server/slam/readout_estimator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "server/slam/optimize/lie.h"

namespace romap::slam::readout_estimator_test {

const CameraModel kCamera{
    .width_px = 640, .height_px = 480, .fx_px = 500, .fy_px = 500, .cx_px = 319.5, .cy_px = 239.5};

// Frames of a shaking camera in front of random points at exactly known poses, with a readout time that the features
// were not corrected for.
ReadoutEstimator EstimatorAfter(int frames, double readout_s, double speed_rad_per_s) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> noise_px(0, 0.5);
  ReadoutEstimator estimator;
  for (int i = 0; i < frames; ++i) {
    ReadoutMotion motion;
    motion.rotation_rad = speed_rad_per_s * Eigen::Vector3d(uniform(random), uniform(random), uniform(random));
    motion.translation_mu = speed_rad_per_s * Eigen::Vector3d(uniform(random), uniform(random), uniform(random));
    std::vector<ReadoutEstimator::Observation> observations;
    for (int k = 0; k < 150; ++k) {
      const double u = 319.5 + 300 * uniform(random), v = 239.5 + 220 * uniform(random);
      const Eigen::Vector3d p = (2 + uniform(random)) * kCamera.Unproject(u, v);
      const double s = v / (kCamera.height_px - 1) - 0.5;
      const double time_s = s * readout_s;
      const Eigen::Vector3d p_read = ExpRotation(-time_s * motion.rotation_rad) * (p - time_s * motion.translation_mu);
      const Eigen::Vector2d pixel_px = kCamera.Project(p_read) + Eigen::Vector2d(noise_px(random), noise_px(random));
      observations.push_back({.observation = {.p_world = p, .pixel_px = pixel_px, .sigma_px = 0.5}, .read_at = s});
    }
    estimator.AddFrame(kCamera, {}, observations, motion);
  }
  return estimator;
}

TEST(ReadoutEstimatorTest, FindsTheReadoutTime) {
  const auto error = EstimatorAfter(150, 0.02, 1.5).Estimate();
  ASSERT_TRUE(error.has_value());
  EXPECT_NEAR(error->value_s, 0.02, 0.001);
  EXPECT_LT(error->sigma_s, 0.001);
}

TEST(ReadoutEstimatorTest, AGlobalShutterHasNone) {
  const auto error = EstimatorAfter(150, 0, 1.5).Estimate();
  ASSERT_TRUE(error.has_value());
  EXPECT_LT(std::abs(error->value_s), 0.001);
}

TEST(ReadoutEstimatorTest, FewFramesOrAStaticCameraDoNotDetermineIt) {
  EXPECT_FALSE(EstimatorAfter(30, 0.02, 1.5).Estimate().has_value());
  EXPECT_FALSE(EstimatorAfter(150, 0.02, 0.01).Estimate().has_value());
}

}  // namespace romap::slam::readout_estimator_test
