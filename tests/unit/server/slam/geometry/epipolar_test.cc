#include "server/slam/geometry/epipolar.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/unit/server/slam/geometry/gradient_check.h"
#include "tests/unit/server/slam/geometry/synthetic_scene.h"

namespace romap::slam::epipolar_test {

Motion TestMotion() { return {RotationXyz(3, -5, 8).toRotationMatrix(), Eigen::Vector3d(0.8, -0.1, 0.3).normalized()}; }

// A match of a point in front of both cameras, with an error of `error_px` in the second image.
RayMatch MakeMatch(const CameraModel& camera, const Eigen::Vector3d& p_first, const Eigen::Vector2d& error_px) {
  const Motion motion = TestMotion();
  const Eigen::Vector2d first_px = camera.Project(p_first);
  const Eigen::Vector2d second_px = camera.Project(motion.rotation * p_first + motion.direction) + error_px;
  return {camera.Unproject(first_px.x(), first_px.y()), camera.Unproject(second_px.x(), second_px.y()), 1.5};
}

TEST(Epipolar, ExactMatchesSatisfyTheConstraintAndIntersectAtThePoint) {
  const CameraModel camera = TestCamera();
  const Eigen::Vector3d p_first(0.4, -0.3, 5);
  const RayMatch match = MakeMatch(camera, p_first, {0, 0});
  EXPECT_NEAR(SampsonChi2(camera, TestMotion().Essential(), match), 0, 1e-18);
  const RayIntersection intersection = Intersect(camera, TestMotion(), match);
  EXPECT_NEAR(intersection.first_depth, 5, 1e-9);
  EXPECT_NEAR(intersection.second_depth, (TestMotion().rotation * p_first + TestMotion().direction).z(), 1e-9);
  EXPECT_TRUE(intersection.is_significant);
  EXPECT_TRUE(intersection.IsInFrontOfBoth());
}

TEST(Epipolar, SampsonErrorIsTheDistanceToTheCorrectedMatch) {
  const CameraModel camera = TestCamera();
  const Eigen::Matrix3d essential = TestMotion().Essential();
  const RayMatch match = MakeMatch(camera, {0.4, -0.3, 5}, {2, -3});
  const RayMatch corrected = ClosestEpipolarMatch(camera, essential, match);
  const double moved2_px2 = (camera.Project(corrected.first) - camera.Project(match.first)).squaredNorm() +
                            (camera.Project(corrected.second) - camera.Project(match.second)).squaredNorm();
  const double chi2 = SampsonChi2(camera, essential, match);
  EXPECT_GT(chi2, 0.1);
  EXPECT_NEAR(moved2_px2 / (1.5 * 1.5), chi2, 1e-9);
  EXPECT_LT(SampsonChi2(camera, essential, corrected), 1e-4 * chi2);
}

TEST(Epipolar, OppositeDirectionPutsPointsBehindTheCameras) {
  const CameraModel camera = TestCamera();
  const RayMatch match = MakeMatch(camera, {0.4, -0.3, 5}, {0, 0});
  const Motion opposite{TestMotion().rotation, -TestMotion().direction};
  EXPECT_FALSE(Intersect(camera, opposite, match).IsInFrontOfBoth());
  EXPECT_EQ(Support(camera, opposite, {&match, 1}), 0);
  EXPECT_NEAR(Support(camera, TestMotion(), {&match, 1}), 1, 1e-12);
}

TEST(Epipolar, GradientAgreesWithFiniteDifferences) {
  const CameraModel camera = TestCamera();
  const auto move = [](const Motion& at, const MotionEquations::Vector& step) { return ApplyStep(at, step); };
  for (const Eigen::Vector2d& error_px :
       {Eigen::Vector2d(1, -2), Eigen::Vector2d(-6, 12)}) {  // within Huber's bound, beyond it
    const RayMatch match = MakeMatch(camera, {0.4, -0.3, 5}, error_px);
    const auto linearize = [&](const Motion& at) { return EpipolarEquations(camera, at, {&match, 1}); };
    ExpectGradientOfCost<5>(linearize, move, TestMotion());
  }
}

TEST(Epipolar, SigmasMatchTheActualErrors) {
  const CameraModel camera = TestCamera();
  const Motion truth = TestMotion();
  double error2 = 0;
  double sigma2 = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    Noise noise(seed);
    std::vector<RayMatch> matches;
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector2d pixel_px = noise.Pixel(camera);
      const Eigen::Vector3d p_first = noise.Uniform(4, 9) * camera.Unproject(pixel_px.x(), pixel_px.y());
      matches.push_back(MakeMatch(camera, p_first, noise.Normal2(1.5)));
      matches.back().sigma_px = 1.5 / std::sqrt(2);  // the noise of one image, distributed over two
    }
    const RefinedMotion refined = RefineMotion(camera, truth, matches);
    const double error_rad = Eigen::AngleAxisd(truth.rotation.transpose() * refined.motion.rotation).angle();
    error2 += error_rad * error_rad;
    sigma2 += refined.rotation_sigma_rad * refined.rotation_sigma_rad;
  }
  EXPECT_GT(error2, 0.4 * sigma2);
  EXPECT_LT(error2, 4 * sigma2);  // the error has three axes, and outlier rejection removes the tail of the noise
}

}  // namespace romap::slam::epipolar_test
