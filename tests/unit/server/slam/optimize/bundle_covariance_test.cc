#include "server/slam/optimize/bundle_covariance.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <vector>

#include "tests/unit/server/slam/optimize/bundle_world.h"

namespace romap::slam::bundle_covariance_test {

// Cameras on half an orbit. The points connect only neighbors, so that errors accumulate along the chain.
BundleWorldOptions Chain(bool with_depth) {
  BundleWorldOptions options;
  options.cameras = 12;
  options.fixed_cameras = 1;
  options.step_rad = 0.25;
  options.points = 300;
  options.observations_per_point = 4;
  options.with_depth = with_depth;
  return options;
}

struct Statistics {
  double position = 0;  // mean squared errors, normalized by the covariance; 3 if it is right
  double rotation = 0;
  std::vector<double> position_by_camera;  // ratio of mean squared error and trace of the covariance
};

// Adjusts the world many times with other noise and compares the errors after alignment with the covariance.
Statistics MeasureErrors(bool with_depth, int runs) {
  const BundleWorld exact = MakeBundleWorld(Chain(with_depth));
  const size_t cameras = exact.true_poses.size();
  Statistics statistics{.position_by_camera = std::vector<double>(cameras, 0)};
  std::mt19937_64 random(17);
  std::normal_distribution<double> normal;
  for (int run = 0; run < runs; ++run) {
    BundleProblem problem = exact.problem;
    for (BundleObservation& observation : problem.observations) {
      observation.pixel_px.x() += normal(random);
      observation.pixel_px.y() += normal(random);
    }
    AdjustBundle(problem, {.max_iterations = 20, .function_tolerance = 1e-8, .reject_outliers = false, .dense = true});
    for (BundleObservation& observation : problem.observations) observation.outlier = false;
    const std::vector<CameraCovariance> covariances = BundleCovariances(problem);
    Eigen::Matrix3Xd estimated(3, cameras), truth(3, cameras);
    for (size_t i = 0; i < cameras; ++i) {
      estimated.col(static_cast<Eigen::Index>(i)) = problem.cameras[i].T_world_camera.translation();
      truth.col(static_cast<Eigen::Index>(i)) = exact.true_poses[i].translation();
    }
    const Eigen::Matrix4d S = Eigen::umeyama(estimated, truth, /*with_scaling=*/!with_depth);
    const Eigen::Quaterniond R(Eigen::Matrix3d(S.topLeftCorner<3, 3>() / S.topLeftCorner<3, 3>().col(0).norm()));
    for (size_t i = 0; i < cameras; ++i) {
      const auto column = static_cast<Eigen::Index>(i);
      const Eigen::Vector3d error =
          (S * estimated.col(column).homogeneous()).head<3>() - Eigen::Vector3d(truth.col(column));
      const Eigen::AngleAxisd rotation(R * problem.cameras[i].T_world_camera.rotation() *
                                       exact.true_poses[i].rotation().conjugate());
      const Eigen::Vector3d rotation_error = rotation.angle() * rotation.axis();
      const double share = 1.0 / (runs * static_cast<double>(cameras));
      statistics.position += share * error.dot(covariances[i].position_mu2.ldlt().solve(error));
      statistics.rotation += share * rotation_error.dot(covariances[i].rotation_rad2.ldlt().solve(rotation_error));
      statistics.position_by_camera[i] += error.squaredNorm() / (covariances[i].position_mu2.trace() * runs);
    }
  }
  return statistics;
}

TEST(BundleCovariances, PredictsTheErrorsAfterAlignmentByASimilarity) {
  const Statistics statistics = MeasureErrors(/*with_depth=*/false, /*runs=*/60);
  EXPECT_NEAR(statistics.position, 3, 0.5);
  EXPECT_NEAR(statistics.rotation, 3, 0.5);
  for (const double ratio : statistics.position_by_camera) EXPECT_NEAR(ratio, 1, 0.6);
}

TEST(BundleCovariances, PredictsTheErrorsAfterRigidAlignmentWithDepth) {
  const Statistics statistics = MeasureErrors(/*with_depth=*/true, /*runs=*/60);
  EXPECT_NEAR(statistics.position, 3, 0.6);
  EXPECT_NEAR(statistics.rotation, 3, 0.6);
}

std::vector<double> PositionVariances(const BundleProblem& problem, const BundleCovarianceOptions& options = {}) {
  std::vector<double> variances_mu2;
  for (const CameraCovariance& covariance : BundleCovariances(problem, options)) {
    variances_mu2.push_back(covariance.position_mu2.trace());
  }
  return variances_mu2;
}

BundleProblem NoisyChain(int cameras, int points) {
  BundleWorldOptions options = Chain(false);
  options.cameras = cameras;
  options.points = points;
  options.pixel_noise_px = 0.5;
  return MakeBundleWorld(options).problem;
}

TEST(BundleCovariances, ErrorsGrowTowardTheEndsOfAChain) {
  const std::vector<double> variances_mu2 = PositionVariances(NoisyChain(12, 300));
  ASSERT_EQ(variances_mu2.size(), 12U);
  EXPECT_GT(variances_mu2.front(), 2 * variances_mu2[6]);
  EXPECT_GT(variances_mu2.back(), 2 * variances_mu2[6]);
}

TEST(BundleCovariances, ALoopReducesTheErrors) {
  BundleProblem problem = NoisyChain(12, 300);
  const std::vector<double> open = PositionVariances(problem);
  const std::vector<BundleObservation> observations = problem.observations;
  for (BundleObservation observation : observations) {
    if (observation.camera != 0) continue;
    observation.camera = 11;  // the last one observes the same points
    const Eigen::Vector3d p_camera = problem.cameras[11].T_world_camera.Inverse() *
                                     problem.points[static_cast<size_t>(observation.point)].position_world;
    observation.pixel_px = problem.camera.Project(p_camera);
    problem.observations.push_back(observation);
  }
  EXPECT_LT(PositionVariances(problem).back(), 0.7 * open.back());
}

TEST(BundleCovariances, ASelectionStandsForAllCamerasAndPoints) {
  const BundleProblem problem = NoisyChain(40, 2000);
  const std::vector<double> all = PositionVariances(problem);
  const std::vector<double> fewer_points = PositionVariances(problem, {.max_points = 500});
  ASSERT_EQ(fewer_points.size(), 40U);
  for (size_t i = 0; i < all.size(); ++i) EXPECT_NEAR(std::sqrt(fewer_points[i] / all[i]), 1, 0.4) << i;
  const std::vector<double> fewer_cameras = PositionVariances(problem, {.max_cameras = 20});
  ASSERT_EQ(fewer_cameras.size(), 40U);
  for (const double variance_mu2 : fewer_cameras) EXPECT_GT(variance_mu2, 0);
}

TEST(BundleCovariances, AreEmptyWithoutSharedPoints) {
  BundleProblem problem = NoisyChain(12, 300);
  problem.observations.clear();
  EXPECT_TRUE(BundleCovariances(problem).empty());
  EXPECT_TRUE(BundleCovariances({}).empty());
}

}  // namespace romap::slam::bundle_covariance_test
