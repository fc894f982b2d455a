#include "server/slam/optimize/bundle_adjustment.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <thread>

#include "tests/unit/server/slam/optimize/bundle_world.h"

namespace romap::slam::bundle_adjustment_test {

BundleWorldOptions NoisyStart() {
  BundleWorldOptions options;
  options.fixed_cameras = 4;  // a baseline long enough that scale is not the largest error
  options.pixel_noise_px = 0.5;
  options.pose_noise_rad = 0.005;
  options.pose_noise_mu = 0.02;
  options.point_noise_mu = 0.05;
  return options;
}

double RmsPoseErrorMu(const BundleWorld& world) {
  double sum = 0;
  for (size_t i = 0; i < world.true_poses.size(); ++i) {
    sum += (world.problem.cameras[i].T_world_camera.translation() - world.true_poses[i].translation()).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(world.true_poses.size()));
}

double RmsRotationErrorRad(const BundleWorld& world) {
  double sum = 0;
  for (size_t i = 0; i < world.true_poses.size(); ++i) {
    const double error_rad =
        world.problem.cameras[i].T_world_camera.rotation().angularDistance(world.true_poses[i].rotation());
    sum += error_rad * error_rad;
  }
  return std::sqrt(sum / static_cast<double>(world.true_poses.size()));
}

double RmsPointErrorMu(const BundleWorld& world) {
  double sum = 0;
  for (size_t i = 0; i < world.true_points.size(); ++i) {
    sum += (world.problem.points[i].position_world - world.true_points[i]).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(world.true_points.size()));
}

bool Same(const BundleProblem& a, const BundleProblem& b) {
  for (size_t i = 0; i < a.cameras.size(); ++i) {
    const SE3<World, Camera>& first = a.cameras[i].T_world_camera;
    const SE3<World, Camera>& second = b.cameras[i].T_world_camera;
    if (first.translation() != second.translation()) return false;
    if (first.rotation().coeffs() != second.rotation().coeffs()) return false;
  }
  for (size_t i = 0; i < a.points.size(); ++i) {
    if (a.points[i].position_world != b.points[i].position_world) return false;
  }
  return true;
}

TEST(BundleAdjustment, RecoversTheExactSceneWithoutNoise) {
  BundleWorldOptions options = NoisyStart();
  options.pixel_noise_px = 0;
  for (const bool dense : {false, true}) {
    BundleWorld world = MakeBundleWorld(options);
    const BundleSummary summary = AdjustBundle(world.problem, {.max_iterations = 30, .dense = dense});
    EXPECT_TRUE(summary.usable);
    EXPECT_GT(summary.initial_rms_px, 5);
    EXPECT_LT(summary.final_rms_px, 1e-3);
    EXPECT_EQ(summary.outliers, 0);
    EXPECT_LT(RmsPoseErrorMu(world), 1e-4);
    EXPECT_LT(RmsRotationErrorRad(world), 1e-4);
    EXPECT_LT(RmsPointErrorMu(world), 1e-4);
  }
}

TEST(BundleAdjustment, TheResultDoesNotDependOnTheOrigin) {
  const Eigen::Vector3d origin(500'000, -6'400'000, 100);
  BundleWorld near = MakeBundleWorld(NoisyStart());
  BundleWorld distant = near;
  for (BundleCamera& camera : distant.problem.cameras) {
    camera.T_world_camera = {camera.T_world_camera.rotation(),
                             Eigen::Vector3d(camera.T_world_camera.translation() + origin)};
  }
  for (BundlePoint& point : distant.problem.points) point.position_world += origin;
  const BundleOptions options{.max_iterations = 30};
  const BundleSummary near_summary = AdjustBundle(near.problem, options);
  const BundleSummary distant_summary = AdjustBundle(distant.problem, options);
  EXPECT_EQ(distant_summary.iterations, near_summary.iterations);
  EXPECT_NEAR(distant_summary.final_rms_px, near_summary.final_rms_px, 1e-6);
  for (size_t i = 0; i < near.problem.cameras.size(); ++i) {
    const Eigen::Vector3d moved = distant.problem.cameras[i].T_world_camera.translation() - origin;
    EXPECT_LT((moved - near.problem.cameras[i].T_world_camera.translation()).norm(), 1e-6) << i;
  }
}

TEST(BundleAdjustment, AccuracyMatchesTheNoise) {
  BundleWorld world = MakeBundleWorld(NoisyStart());
  const double pose_before_mu = RmsPoseErrorMu(world);
  const BundleSummary summary = AdjustBundle(world.problem, {.dense = true});
  EXPECT_TRUE(summary.usable);
  // Two residuals of 0.5 px per observation, reduced by the degrees of freedom of the parameters.
  const double freedom = 1 - (6 * 6 + 200 * 3) / (2.0 * static_cast<double>(world.problem.observations.size()));
  EXPECT_NEAR(summary.final_rms_px, 0.5 * std::sqrt(2 * freedom), 0.05);
  // The bound accepts 95 % of the observations.
  EXPECT_LT(summary.outliers, 0.08 * static_cast<double>(world.problem.observations.size()));
  EXPECT_LT(RmsPoseErrorMu(world), 0.25 * pose_before_mu);
  EXPECT_LT(RmsPoseErrorMu(world), 0.008);
  EXPECT_LT(RmsRotationErrorRad(world), 0.003);
  EXPECT_LT(RmsPointErrorMu(world), 0.02);
}

TEST(BundleAdjustment, ToleratesTenPercentOutliers) {
  BundleWorldOptions options = NoisyStart();
  options.observations_per_point = 8;
  BundleWorld clean = MakeBundleWorld(options);
  ASSERT_TRUE(AdjustBundle(clean.problem, {.dense = true}).usable);
  options.outlier_share = 0.1;
  BundleWorld world = MakeBundleWorld(options);
  const BundleSummary summary = AdjustBundle(world.problem, {.max_iterations = 20, .dense = true});
  EXPECT_TRUE(summary.usable);
  int wrong = 0;
  int found = 0;
  for (size_t i = 0; i < world.wrong.size(); ++i) {
    wrong += world.wrong[i];
    found += world.wrong[i] && world.problem.observations[i].outlier;
  }
  EXPECT_GT(wrong, 100);
  EXPECT_GT(found, 0.99 * wrong);
  EXPECT_LT(RmsPoseErrorMu(world), 2 * RmsPoseErrorMu(clean) + 0.001);
  EXPECT_LT(summary.final_rms_px, 0.8);
}

TEST(BundleAdjustment, MarkedOutliersAreIgnoredAndReclassified) {
  BundleWorld world = MakeBundleWorld(NoisyStart());
  BundleObservation& wrong = world.problem.observations[10];
  wrong.pixel_px.x() += 300;
  wrong.outlier = true;
  BundleObservation& right = world.problem.observations[20];
  right.outlier = true;
  BundleProblem without = world.problem;
  without.observations[10].pixel_px.x() -= 299;  // the pixel of an ignored observation has no effect
  ASSERT_TRUE(AdjustBundle(world.problem, {.dense = true}).usable);
  ASSERT_TRUE(AdjustBundle(without, {.dense = true}).usable);
  EXPECT_TRUE(Same(world.problem, without));
  EXPECT_TRUE(wrong.outlier);
  EXPECT_FALSE(right.outlier);
}

TEST(BundleAdjustment, FixedParametersDoNotChange) {
  BundleWorldOptions options = NoisyStart();
  BundleWorld world = MakeBundleWorld(options);
  for (size_t i = 0; i < 50; ++i) {
    world.problem.points[i] = {world.true_points[i], true};
  }
  const BundleProblem before = world.problem;
  ASSERT_TRUE(AdjustBundle(world.problem, {}).usable);
  for (size_t i = 0; i < before.cameras.size(); ++i) {
    const SE3<World, Camera>& now = world.problem.cameras[i].T_world_camera;
    const SE3<World, Camera>& start = before.cameras[i].T_world_camera;
    const bool same = now.translation() == start.translation() && now.rotation().coeffs() == start.rotation().coeffs();
    EXPECT_EQ(same, i < 4) << i;
  }
  for (size_t i = 0; i < 50; ++i) {
    EXPECT_EQ(world.problem.points[i].position_world, before.points[i].position_world) << i;
  }
  EXPECT_LT(RmsPoseErrorMu(world), 0.008);
}

TEST(BundleAdjustment, PointsObservedOnlyByFixedCamerasStayAndAreClassified) {
  BundleWorldOptions options = NoisyStart();
  options.fixed_cameras = 6;
  BundleWorld world = MakeBundleWorld(options);
  BundleProblem& problem = world.problem;
  problem.points.push_back({Eigen::Vector3d(0.1, 0.2, 0.3), false});
  const int point = static_cast<int>(problem.points.size()) - 1;
  for (int camera = 0; camera < 3; ++camera) {
    BundleObservation observation;
    observation.camera = camera;
    observation.point = point;
    observation.pixel_px =
        problem.camera.Project(problem.cameras[camera].T_world_camera.Inverse() * problem.points[point].position_world);
    if (camera == 2) observation.pixel_px.x() += 10;
    problem.observations.push_back(observation);
  }
  ASSERT_TRUE(AdjustBundle(problem, {}).usable);
  EXPECT_EQ(problem.points[point].position_world, Eigen::Vector3d(0.1, 0.2, 0.3));
  const size_t last = problem.observations.size() - 1;
  EXPECT_FALSE(problem.observations[last - 1].outlier);
  EXPECT_TRUE(problem.observations[last].outlier);
}

TEST(BundleAdjustment, DoesNotDependOnTheUnitOfTheMap) {
  BundleWorldOptions options = NoisyStart();
  options.with_depth = true;
  options.outlier_share = 0.03;
  BundleWorld world = MakeBundleWorld(options);
  const BundleSummary summary = AdjustBundle(world.problem, {.dense = true});
  ASSERT_TRUE(summary.usable);
  for (const double unit : {0.01, 100.0}) {
    options.scale = unit;
    BundleWorld scaled = MakeBundleWorld(options);
    const BundleSummary scaled_summary = AdjustBundle(scaled.problem, {.dense = true});
    ASSERT_TRUE(scaled_summary.usable);
    EXPECT_EQ(scaled_summary.iterations, summary.iterations);
    EXPECT_EQ(scaled_summary.outliers, summary.outliers);
    EXPECT_NEAR(scaled_summary.final_rms_px, summary.final_rms_px, 1e-6);
    for (size_t i = 0; i < world.problem.cameras.size(); ++i) {
      EXPECT_LT((scaled.problem.cameras[i].T_world_camera.translation() / unit -
                 world.problem.cameras[i].T_world_camera.translation())
                    .norm(),
                1e-7);
    }
  }
}

TEST(BundleAdjustment, IsDeterministic) {
  BundleWorldOptions options = NoisyStart();
  options.outlier_share = 0.05;
  for (const bool dense : {false, true}) {
    BundleWorld first = MakeBundleWorld(options);
    BundleWorld second = MakeBundleWorld(options);
    ASSERT_TRUE(AdjustBundle(first.problem, {.dense = dense}).usable);
    ASSERT_TRUE(AdjustBundle(second.problem, {.dense = dense}).usable);
    EXPECT_TRUE(Same(first.problem, second.problem));
  }
}

TEST(BundleAdjustment, DepthDeterminesTheScale) {
  BundleWorldOptions options = NoisyStart();
  options.fixed_cameras = 1;
  options.with_depth = true;
  BundleWorld world = MakeBundleWorld(options);
  // Everything except the fixed camera and the measured depths is scaled by 1.3.
  const Eigen::Vector3d center_world = world.true_poses[0].translation();
  for (BundleCamera& camera : world.problem.cameras) {
    const SE3<World, Camera>& T = camera.T_world_camera;
    camera.T_world_camera = {T.rotation(), center_world + 1.3 * (T.translation() - center_world)};
  }
  for (BundlePoint& point : world.problem.points) {
    point.position_world = center_world + 1.3 * (point.position_world - center_world);
  }
  const BundleSummary summary = AdjustBundle(world.problem, {.max_iterations = 30, .dense = true});
  EXPECT_TRUE(summary.usable);
  EXPECT_LT(RmsPoseErrorMu(world), 0.01);
  EXPECT_LT(RmsPointErrorMu(world), 0.02);
}

TEST(BundleAdjustment, WrongDepthIsAnOutlier) {
  BundleWorldOptions options = NoisyStart();
  options.with_depth = true;
  BundleWorld world = MakeBundleWorld(options);
  world.problem.observations[7].depth_mu *= 1.5;
  ASSERT_TRUE(AdjustBundle(world.problem, {.dense = true}).usable);
  EXPECT_TRUE(world.problem.observations[7].outlier);
  EXPECT_LT(RmsPoseErrorMu(world), 0.005);
}

TEST(BundleAdjustment, PriorsFixTheGauge) {
  BundleWorldOptions options = NoisyStart();
  options.fixed_cameras = 0;
  BundleWorld world = MakeBundleWorld(options);
  for (size_t i = 0; i < world.problem.cameras.size(); ++i) {
    world.problem.cameras[i].prior = PosePrior{world.true_poses[i], 0.002, 0.005};
  }
  ASSERT_TRUE(AdjustBundle(world.problem, {.dense = true}).usable);
  EXPECT_LT(RmsPoseErrorMu(world), 0.005);
  EXPECT_LT(RmsRotationErrorRad(world), 0.002);
}

TEST(BundleAdjustment, CameraWithOnlyAPriorMovesToThePrior) {
  BundleWorld world = MakeBundleWorld(NoisyStart());
  BundleCamera unobserved;
  unobserved.T_world_camera = OrbitPose(2.0, 1);
  unobserved.prior = PosePrior{OrbitPose(2.1, 1), 0.01, 0.01};
  world.problem.cameras.push_back(unobserved);
  ASSERT_TRUE(AdjustBundle(world.problem, {}).usable);
  const SE3<World, Camera>& reached = world.problem.cameras.back().T_world_camera;
  EXPECT_LT((reached.translation() - OrbitPose(2.1, 1).translation()).norm(), 1e-3);
}

TEST(BundleAdjustment, AbortBeforeTheStartChangesNothing) {
  BundleWorld world = MakeBundleWorld(NoisyStart());
  const BundleProblem before = world.problem;
  const std::atomic<bool> abort = true;
  const BundleSummary summary = AdjustBundle(world.problem, {.abort = &abort});
  EXPECT_TRUE(summary.aborted);
  EXPECT_FALSE(summary.usable);
  EXPECT_EQ(summary.iterations, 0);
  EXPECT_TRUE(Same(world.problem, before));
}

// Whenever the abort arrives, the result is consistent and no worse than the start.
TEST(BundleAdjustment, AbortKeepsTheBestResult) {
  BundleWorldOptions options = NoisyStart();
  options.cameras = 30;
  options.points = 1000;
  for (const int delay_us : {0, 500, 2000, 8000}) {
    BundleWorld world = MakeBundleWorld(options);
    const BundleProblem before = world.problem;
    std::atomic<bool> abort = false;
    std::thread aborter([&] {
      std::this_thread::sleep_for(std::chrono::microseconds(delay_us));
      abort = true;
    });
    const BundleSummary summary = AdjustBundle(world.problem, {.max_iterations = 50, .abort = &abort});
    aborter.join();
    EXPECT_LE(summary.final_rms_px, summary.initial_rms_px);
    EXPECT_EQ(Same(world.problem, before), !summary.usable);
    EXPECT_EQ(summary.usable, summary.iterations > 0);
  }
}

TEST(BundleAdjustment, FewIterationsKeepTheBestSoFar) {
  BundleWorld world = MakeBundleWorld(NoisyStart());
  const BundleSummary summary = AdjustBundle(world.problem, {.max_iterations = 1, .reject_outliers = false});
  EXPECT_TRUE(summary.usable);
  EXPECT_EQ(summary.iterations, 1);
  EXPECT_LT(summary.final_rms_px, 0.5 * summary.initial_rms_px);
}

TEST(BundleAdjustment, IgnoresInvalidInput) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  BundleWorld world = MakeBundleWorld(NoisyStart());
  BundleProblem clean = world.problem;
  BundleProblem& problem = world.problem;
  const auto add = [&](auto change) {
    BundleObservation observation = problem.observations[3];
    change(observation);
    problem.observations.push_back(observation);
  };
  add([](BundleObservation& observation) { observation.camera = 1000; });
  add([](BundleObservation& observation) { observation.camera = -1; });
  add([](BundleObservation& observation) { observation.point = 1000; });
  add([](BundleObservation& observation) { observation.point = -7; });
  add([&](BundleObservation& observation) { observation.pixel_px.y() = nan; });
  add([](BundleObservation& observation) { observation.sigma_px = 0; });
  add([&](BundleObservation& observation) { observation.sigma_px = nan; });
  add([&](BundleObservation& observation) { observation.depth_mu = nan; });
  problem.points.push_back({Eigen::Vector3d(nan, 0, 0), false});
  add([&](BundleObservation& observation) { observation.point = static_cast<int>(problem.points.size()) - 1; });
  problem.points.push_back({Eigen::Vector3d(100, 0, 0), false});  // behind the camera
  add([&](BundleObservation& observation) { observation.point = static_cast<int>(problem.points.size()) - 1; });
  BundleCamera invalid_camera;
  invalid_camera.T_world_camera = {Eigen::Quaterniond::Identity(), Eigen::Vector3d(nan, 0, 0)};
  invalid_camera.prior = PosePrior{};
  problem.cameras.push_back(invalid_camera);
  add([&](BundleObservation& observation) { observation.camera = static_cast<int>(problem.cameras.size()) - 1; });
  problem.cameras[5].prior = PosePrior{problem.cameras[5].T_world_camera, 0, nan};

  ASSERT_TRUE(AdjustBundle(clean, {.dense = true}).usable);
  const size_t valid_observations = clean.observations.size();
  ASSERT_TRUE(AdjustBundle(problem, {.dense = true}).usable);
  for (size_t i = 0; i < clean.cameras.size(); ++i) {
    EXPECT_EQ(problem.cameras[i].T_world_camera.translation(), clean.cameras[i].T_world_camera.translation()) << i;
  }
  for (size_t i = valid_observations; i < problem.observations.size(); ++i)
    EXPECT_TRUE(problem.observations[i].outlier) << i;
}

TEST(BundleAdjustment, IsNotUsableIfThereIsNothingToOptimize) {
  BundleProblem empty;
  EXPECT_FALSE(AdjustBundle(empty, {}).usable);
  empty.camera = BundleWorldCamera();
  EXPECT_FALSE(AdjustBundle(empty, {}).usable);

  BundleWorldOptions options = NoisyStart();
  options.fixed_cameras = options.cameras;
  BundleWorld all_fixed = MakeBundleWorld(options);
  const BundleProblem before = all_fixed.problem;
  EXPECT_FALSE(AdjustBundle(all_fixed.problem, {}).usable);
  EXPECT_TRUE(Same(all_fixed.problem, before));

  BundleWorld invalid_focal_length = MakeBundleWorld(NoisyStart());
  invalid_focal_length.problem.camera.fx_px = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(AdjustBundle(invalid_focal_length.problem, {}).usable);
  BundleWorld no_iterations = MakeBundleWorld(NoisyStart());
  EXPECT_FALSE(AdjustBundle(no_iterations.problem, {.max_iterations = 0}).usable);
}

TEST(BundleAdjustment, IgnoresPointsBehindTheCamera) {
  BundleWorld world = MakeBundleWorld(NoisyStart());
  for (size_t i = 0; i < 10; ++i) world.problem.points[i].position_world = Eigen::Vector3d(30, 5, 0);
  ASSERT_TRUE(AdjustBundle(world.problem, {.dense = true}).usable);
  for (const BundleObservation& observation : world.problem.observations) {
    EXPECT_TRUE(observation.point >= 10 || observation.outlier);
  }
  EXPECT_LT(RmsPoseErrorMu(world), 0.008);
}

TEST(BundleFitTest, MeasuresTheNoiseInSpiteOfOutliers) {
  BundleWorldOptions options;
  options.pixel_noise_px = 0.5;
  BundleWorld world = MakeBundleWorld(options);
  const double claimed_px = world.problem.observations[0].sigma_px;
  EXPECT_NEAR(MeasureNoise(world.problem) * claimed_px, 0.5, 0.05);
  for (size_t i = 0; i < world.problem.observations.size(); i += 10) world.problem.observations[i].pixel_px.x() += 50;
  EXPECT_NEAR(MeasureNoise(world.problem) * claimed_px, 0.5, 0.1);
}

TEST(BundleFitTest, CountsOutliers) {
  BundleWorld world = MakeBundleWorld({});
  EXPECT_EQ(MeasureFit(world.problem).outliers, 0);
  for (size_t i = 0; i < 5; ++i) world.problem.observations[i].pixel_px.x() += 50;
  const BundleFit fit = MeasureFit(world.problem);
  EXPECT_EQ(fit.outliers, 5);
  EXPECT_EQ(fit.observations, static_cast<int>(world.problem.observations.size()));
  EXPECT_LT(fit.rms_px, 1);
  ClassifyOutliers(world.problem);
  EXPECT_TRUE(world.problem.observations[0].outlier);
  EXPECT_FALSE(world.problem.observations[5].outlier);
}

}  // namespace romap::slam::bundle_adjustment_test
