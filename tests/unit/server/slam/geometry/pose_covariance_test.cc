#include "server/slam/geometry/pose_covariance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "common/statistics.h"
#include "tests/unit/server/slam/geometry/synthetic_scene.h"

namespace romap::slam::pose_covariance_test {

using Vector6 = Eigen::Matrix<double, 6, 1>;

const SE3<World, Camera> kTruth(RotationXyz(20, -35, 10), {0.3, -1.2, 0.7});

// Exact observations, which claim `sigma_px`.
std::vector<PoseObservation> Observe(const std::vector<Eigen::Vector3d>& points_camera, double sigma_px) {
  std::vector<PoseObservation> observations;
  for (const Eigen::Vector3d& p_camera : points_camera) {
    observations.push_back(
        {.p_world = kTruth * p_camera, .pixel_px = TestCamera().Project(p_camera), .sigma_px = sigma_px});
  }
  return observations;
}

std::vector<Eigen::Vector3d> RandomPoints(int count, uint64_t seed) {
  Noise noise(seed);
  std::vector<Eigen::Vector3d> points_camera;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d pixel_px = noise.Pixel(TestCamera());
    points_camera.push_back(noise.Uniform(1, 5) * TestCamera().Unproject(pixel_px.x(), pixel_px.y()));
  }
  return points_camera;
}

struct Estimated {
  Vector6 error;  // position along the camera's axes, then rotation vector
  Eigen::Matrix<double, 6, 6> covariance;
};

Estimated EstimateOnce(std::vector<PoseObservation> observations, double noise_px, uint64_t seed) {
  Noise noise(seed);
  for (PoseObservation& observation : observations) observation.pixel_px += noise.Normal2(noise_px);
  const PoseEstimate estimate = RefinePose(TestCamera(), kTruth, observations);
  const SE3<Camera, Camera> difference = kTruth.Inverse() * estimate.T_world_camera;
  const Eigen::AngleAxisd rotation(difference.rotation());
  Estimated estimated;
  estimated.error << difference.translation(), rotation.angle() * rotation.axis();
  estimated.covariance = PoseCovariance(TestCamera(), estimate, observations).value();
  return estimated;
}

Eigen::Matrix<double, 6, 6> Covariance(const std::vector<PoseObservation>& observations) {
  return EstimateOnce(observations, 1, 9).covariance;
}

double PositionSigma(const Eigen::Matrix<double, 6, 6>& covariance) {
  return EquivalentSigma(covariance.topLeftCorner<3, 3>());
}

TEST(PoseCovariance, PredictsTheErrorsOfManyEstimates) {
  constexpr int kRuns = 600;
  // The claimed noise is twice the actual one: the covariance must follow the actual one.
  const std::vector<PoseObservation> observations = Observe(RandomPoints(80, 1), /*sigma_px=*/2);
  double normalized = 0;
  int position_within = 0, rotation_within = 0;
  for (int run = 0; run < kRuns; ++run) {
    const Estimated estimated = EstimateOnce(observations, /*noise_px=*/1, static_cast<uint64_t>(100 + run));
    normalized += estimated.error.dot(estimated.covariance.ldlt().solve(estimated.error)) / kRuns;
    const double rotation_sigma = EquivalentSigma(estimated.covariance.bottomRightCorner<3, 3>());
    position_within += estimated.error.head<3>().norm() <= kSigmasTo95 * PositionSigma(estimated.covariance) ? 1 : 0;
    rotation_within += estimated.error.tail<3>().norm() <= kSigmasTo95 * rotation_sigma ? 1 : 0;
  }
  // Chi-square with six degrees of freedom has the mean 6; the mean of the runs has the standard deviation 0.14. At
  // twice the actual noise no observation is rejected, and the share that the 95 % bound would remove is not missing.
  EXPECT_NEAR(normalized, 6 * 0.842, 0.6);
  EXPECT_NEAR(position_within, 0.965 * kRuns, 0.025 * kRuns);
  EXPECT_NEAR(rotation_within, 0.965 * kRuns, 0.025 * kRuns);
}

TEST(PoseCovariance, PredictsErrorsIfOutliersAreRejected) {
  constexpr int kRuns = 600;
  const std::vector<PoseObservation> observations = Observe(RandomPoints(80, 2), /*sigma_px=*/1);
  double normalized = 0;
  for (int run = 0; run < kRuns; ++run) {
    const Estimated estimated = EstimateOnce(observations, /*noise_px=*/1, static_cast<uint64_t>(900 + run));
    normalized += estimated.error.dot(estimated.covariance.ldlt().solve(estimated.error)) / kRuns;
  }
  EXPECT_NEAR(normalized, 6, 1);
}

TEST(PoseCovariance, MorePointsGiveASmallerSigma) {
  const double few = PositionSigma(Covariance(Observe(RandomPoints(50, 3), 1)));
  const double many = PositionSigma(Covariance(Observe(RandomPoints(800, 3), 1)));
  EXPECT_NEAR(few / many, 4, 1.2) << "sixteen times the points";
}

// In a vertical strip, a shift to the side looks like a rotation about the vertical axis.
TEST(PoseCovariance, AStripOfPointsLeavesItsWeakDirection) {
  Noise noise(4);
  std::vector<Eigen::Vector3d> strip, spread;
  for (int i = 0; i < 100; ++i) {
    const double y = noise.Uniform(-1, 1);
    strip.emplace_back(noise.Uniform(-0.02, 0.02), y, 3);
    spread.emplace_back(noise.Uniform(-1, 1), y, 3);
  }
  const auto of_strip = Covariance(Observe(strip, 1));
  const auto of_spread = Covariance(Observe(spread, 1));
  EXPECT_GT(of_strip(0, 0), 100 * of_strip(1, 1));
  EXPECT_LT(of_spread(0, 0), 5 * of_spread(1, 1));
  EXPECT_GT(PositionSigma(of_strip), 5 * PositionSigma(of_spread));
}

TEST(PoseCovariance, DepthReducesTheErrorAlongTheRay) {
  Noise noise(5);
  std::vector<Eigen::Vector3d> points_camera;
  for (int i = 0; i < 40; ++i) points_camera.push_back(Eigen::Vector3d(0, 0, 5) + noise.Normal3(0.05));
  std::vector<PoseObservation> observations = Observe(points_camera, 1);
  const double without = Covariance(observations)(2, 2);
  for (size_t i = 0; i < observations.size(); ++i) {
    observations[i].depth_mu = points_camera[i].z() + noise.Normal(0.01);
    observations[i].depth_sigma_mu = 0.01;
  }
  EXPECT_LT(Covariance(observations)(2, 2), 0.01 * without);
}

TEST(PoseCovariance, NeedsMoreErrorsThanParameters) {
  const std::vector<PoseObservation> observations = Observe(RandomPoints(3, 6), 1);
  const PoseEstimate estimate{.T_world_camera = kTruth, .inlier = {1, 1, 1}, .inliers = 3};
  EXPECT_FALSE(PoseCovariance(TestCamera(), estimate, observations).has_value());
}

TEST(EquivalentSigma, GivesThe95PercentBoundForAnyShape) {
  for (const Eigen::Vector3d& sigmas :
       {Eigen::Vector3d(1, 1, 1), Eigen::Vector3d(1, 0.1, 0.01), Eigen::Vector3d(3, 3, 1)}) {
    Noise noise(7);
    std::vector<double> lengths;
    for (int i = 0; i < 20'000; ++i) lengths.push_back(sigmas.cwiseProduct(noise.Normal3(1)).norm());
    const double sigma = EquivalentSigma(sigmas.cwiseAbs2().asDiagonal());
    EXPECT_NEAR(kSigmasTo95 * sigma / Quantile(lengths, 0.95), 1, 0.035) << sigmas.transpose();
  }
  EXPECT_NEAR(EquivalentSigma(Eigen::Matrix3d::Identity()), 1, 0.01) << "the standard deviation per axis";
  EXPECT_EQ(EquivalentSigma(Eigen::Matrix3d::Zero()), 0);
}

}  // namespace romap::slam::pose_covariance_test
