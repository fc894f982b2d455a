#include "server/slam/optimize/radial_correction.h"

#include <gtest/gtest.h>

#include "server/slam/optimize/bundle_adjustment.h"
#include "tests/unit/server/slam/optimize/bundle_world.h"

namespace romap::slam::radial_correction_test {

constexpr BundleOptions kManyIterations{.max_iterations = 30, .function_tolerance = 1e-6};

BundleWorldOptions NoisyStart(double pixel_noise_px) {
  BundleWorldOptions options;
  options.fixed_cameras = 2;
  options.points = 400;
  options.pixel_noise_px = pixel_noise_px;
  options.pose_noise_rad = 0.005;
  options.pose_noise_mu = 0.02;
  options.point_noise_mu = 0.05;
  return options;
}

TEST(RadialCorrection, DistortAndUndistortAreInverse) {
  const CameraModel model = BundleWorldCamera();
  for (const double k1 : {-0.1, 0.0, 0.05}) {
    const RadialCorrection lens{k1};
    for (const Eigen::Vector2d& observed_px :
         {Eigen::Vector2d(0, 0), Eigen::Vector2d(320, 240), Eigen::Vector2d(600, 90)}) {
      EXPECT_LT((lens.Distort(model, lens.Undistort(model, observed_px)) - observed_px).norm(), 0.02) << k1;
    }
  }
}

TEST(RadialCorrection, BundleAdjustmentEstimatesTheDistortion) {
  for (const bool with_depth : {false, true}) {
    BundleWorldOptions options = NoisyStart(0.1);
    options.with_depth = with_depth;
    BundleWorld world = MakeBundleWorld(options);
    const RadialCorrection lens{-0.1};
    for (BundleObservation& observation : world.problem.observations) {
      observation.pixel_px = lens.Distort(world.problem.camera, observation.pixel_px);
    }
    BundleWorld without_lens = world;
    const BundleSummary without = AdjustBundle(without_lens.problem, kManyIterations);
    world.problem.lens = BundleLens{.sigma = 1};
    const BundleSummary with = AdjustBundle(world.problem, kManyIterations);
    ASSERT_TRUE(with.usable);
    EXPECT_NEAR(world.problem.lens->correction.k1, -0.1, 0.02);
    EXPECT_LT(with.outliers, without.outliers);
  }
}

// Noise contains no information about the lens. An error measured in the corrected image would cause that image to
// shrink.
TEST(RadialCorrection, BundleAdjustmentEstimatesNoDistortionFromNoise) {
  BundleWorld world = MakeBundleWorld(NoisyStart(1));
  world.problem.lens = BundleLens{};
  ASSERT_TRUE(AdjustBundle(world.problem, kManyIterations).usable);
  EXPECT_NEAR(world.problem.lens->correction.k1, 0, 0.015);
}

// A prior with a small sigma keeps k1 near 0 although the observations are distorted.
TEST(RadialCorrection, TightPriorDominates) {
  BundleWorld world = MakeBundleWorld(NoisyStart(1));
  for (BundleObservation& observation : world.problem.observations) {
    observation.pixel_px = RadialCorrection{-0.1}.Distort(world.problem.camera, observation.pixel_px);
  }
  world.problem.lens = BundleLens{.sigma = 1e-4};
  ASSERT_TRUE(AdjustBundle(world.problem, kManyIterations).usable);
  EXPECT_NEAR(world.problem.lens->correction.k1, 0, 0.001);
}

}  // namespace romap::slam::radial_correction_test
