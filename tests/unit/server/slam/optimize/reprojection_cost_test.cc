#include "server/slam/optimize/reprojection_cost.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/slam/optimize/lie.h"
#include "tests/unit/server/slam/optimize/bundle_world.h"
#include "tests/unit/server/slam/optimize/jacobians.h"

namespace romap::slam::reprojection_cost_test {

// A camera away from its start, so that the Jacobians of the increment matter, and a point in its view.
struct PointView {
  explicit PointView(const Eigen::Vector3d& p_camera, double rotation_rad = 0.7)
      : camera(SE3<World, Camera>(ExpRotation({0.4, -0.9, 1.3}), {0.5, -0.2, 0.8})) {
    camera.increment = {rotation_rad, -0.5 * rotation_rad, 0.3 * rotation_rad, 0.2, -0.1, 0.15};
    camera.Refresh();
    Eigen::Map<Eigen::Vector3d>(point.data()) = camera.Pose() * p_camera;
  }
  std::vector<double*> Parameters() { return {camera.increment.data(), point.data()}; }

  CameraState camera;
  std::array<double, 3> point{};
};

TEST(ReprojectionCost, IsThePixelErrorInSigmas) {
  PointView view({0.3, -0.2, 1.5});
  const CameraModel model = BundleWorldCamera();
  const Eigen::Vector2d pixel_px = model.Project({0.3, -0.2, 1.5}) + Eigen::Vector2d(3, -4);
  const ReprojectionCost cost(model, &view.camera, pixel_px, 2);
  Eigen::Vector2d residual;
  ASSERT_TRUE(cost.Evaluate(view.Parameters().data(), residual.data(), nullptr));
  EXPECT_LT((residual - Eigen::Vector2d(-1.5, 2)).norm(), 1e-9);
}

TEST(ReprojectionCost, JacobiansMatchFiniteDifferences) {
  for (const double rotation_rad : {0.0, 1e-6, 0.02, 0.7, 2.0}) {
    PointView view({0.3, -0.2, 1.5}, rotation_rad);
    const ReprojectionCost cost(BundleWorldCamera(), &view.camera, {400, 200}, 1.7);
    ExpectJacobiansMatch(cost, view.Parameters(), [&] { view.camera.Refresh(); });
  }
}

TEST(ReprojectionCost, PointBehindTheCameraHasALargeConstantResidual) {
  PointView view({0.3, -0.2, -1.5});
  const ReprojectionCost cost(BundleWorldCamera(), &view.camera, {400, 200}, 1);
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 6, Eigen::RowMajor> by_camera;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
  double* jacobians[] = {by_camera.data(), by_point.data()};
  ASSERT_TRUE(cost.Evaluate(view.Parameters().data(), residual.data(), jacobians));
  EXPECT_GT(residual.norm(), 50);
  EXPECT_TRUE(by_camera.isZero());
  EXPECT_TRUE(by_point.isZero());
}

TEST(LensedCost, IsTheErrorInTheDistortedImage) {
  PointView view({0.6, -0.4, 1.5});
  const CameraModel model = BundleWorldCamera();
  double k1 = -0.1;
  const Eigen::Vector2d observed_px = RadialCorrection{k1}.Distort(model, model.Project({0.6, -0.4, 1.5}));
  const Eigen::Vector2d pixel_px = observed_px + Eigen::Vector2d(3, -4);
  const ReprojectionCost inner(model, &view.camera, pixel_px, 2);
  const LensedCost<ReprojectionCost> cost(model, pixel_px, 2, &inner);
  std::vector<double*> parameters = view.Parameters();
  parameters.push_back(&k1);
  Eigen::Vector2d residual;
  ASSERT_TRUE(cost.Evaluate(parameters.data(), residual.data(), nullptr));
  EXPECT_LT((residual - Eigen::Vector2d(-1.5, 2)).norm(), 1e-9);
}

TEST(LensedCost, JacobiansMatchFiniteDifferences) {
  PointView view({0.6, -0.4, 1.5});
  const CameraModel model = BundleWorldCamera();
  double k1 = -0.1;
  std::vector<double*> parameters = view.Parameters();
  parameters.push_back(&k1);
  const ReprojectionCost pixel(model, &view.camera, {400, 200}, 1.7);
  ExpectJacobiansMatch(LensedCost<ReprojectionCost>(model, {400, 200}, 1.7, &pixel), parameters,
                       [&] { view.camera.Refresh(); });
  const ReprojectionDepthCost depth(model, &view.camera, {400, 200}, 1.7, 2.5, 0.1);
  ExpectJacobiansMatch(LensedCost<ReprojectionDepthCost>(model, {400, 200}, 1.7, &depth), parameters,
                       [&] { view.camera.Refresh(); });
}

TEST(ReprojectionDepthCost, AddsTheErrorOfInverseDepthInSigmas) {
  PointView view({0.3, -0.2, 2.0});
  const CameraModel model = BundleWorldCamera();
  const Eigen::Vector2d pixel_px = model.Project({0.3, -0.2, 2.0}) + Eigen::Vector2d(3, -4);
  // sigma of 1 / depth is 0.1 / 2.5^2.
  const ReprojectionDepthCost cost(model, &view.camera, pixel_px, 2, 2.5, 0.1);
  Eigen::Vector3d residual;
  ASSERT_TRUE(cost.Evaluate(view.Parameters().data(), residual.data(), nullptr));
  EXPECT_LT((residual - Eigen::Vector3d(-1.5, 2, (1 / 2.0 - 1 / 2.5) / (0.1 / 6.25))).norm(), 1e-9);
}

TEST(ReprojectionDepthCost, JacobiansMatchFiniteDifferences) {
  for (const double rotation_rad : {0.0, 0.02, 0.7, 2.0}) {
    PointView view({0.3, -0.2, 1.5}, rotation_rad);
    const ReprojectionDepthCost cost(BundleWorldCamera(), &view.camera, {400, 200}, 1.7, 1.4, 0.001);
    ExpectJacobiansMatch(cost, view.Parameters(), [&] { view.camera.Refresh(); });
  }
}

TEST(ReprojectionDepthCost, PointBehindTheCameraHasALargeConstantResidual) {
  PointView view({0.3, -0.2, -1.5});
  const ReprojectionDepthCost cost(BundleWorldCamera(), &view.camera, {400, 200}, 1, 1.4, 0.05);
  Eigen::Vector3d residual;
  Eigen::Matrix<double, 3, 6, Eigen::RowMajor> by_camera;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> by_point;
  double* jacobians[] = {by_camera.data(), by_point.data()};
  ASSERT_TRUE(cost.Evaluate(view.Parameters().data(), residual.data(), jacobians));
  EXPECT_GT(residual.minCoeff(), 50);
  EXPECT_TRUE(by_camera.isZero());
  EXPECT_TRUE(by_point.isZero());
}

TEST(PosePriorCost, IsTheDistanceInSigmas) {
  CameraState camera(SE3<World, Camera>(ExpRotation({0.4, -0.9, 1.3}), {0.5, -0.2, 0.8}));
  PosePrior prior;
  prior.T_world_camera = SE3<World, Camera>(camera.start_rotation * ExpRotation({0, -0.02, 0}), {0.5, -0.2, 0.5});
  prior.rotation_sigma_rad = 0.01;
  prior.translation_sigma_mu = 0.1;
  const PosePriorCost cost(&camera, prior);
  const double* parameters[] = {camera.increment.data()};
  Eigen::Matrix<double, 6, 1> residual;
  ASSERT_TRUE(cost.Evaluate(parameters, residual.data(), nullptr));
  EXPECT_LT((residual - (Eigen::Matrix<double, 6, 1>() << 0, 2, 0, 0, 0, 3).finished()).norm(), 1e-9);
}

TEST(PosePriorCost, JacobianMatchesFiniteDifferences) {
  for (const double rotation_rad : {0.0, 0.02, 0.7, 2.0}) {
    PointView view({0, 0, 1}, rotation_rad);
    PosePrior prior;
    prior.T_world_camera = SE3<World, Camera>(ExpRotation({0.5, -0.8, 1.2}), {0.4, -0.1, 0.7});
    prior.rotation_sigma_rad = 0.03;
    prior.translation_sigma_mu = 0.2;
    const PosePriorCost cost(&view.camera, prior);
    ExpectJacobiansMatch(cost, {view.camera.increment.data()}, [&] { view.camera.Refresh(); });
  }
}

TEST(CameraState, PoseAgreesWithTheCachedMatrices) {
  const PointView view({0, 0, 1});
  const SE3<World, Camera> pose = view.camera.Pose();
  EXPECT_LT((pose.RotationMatrix().transpose() - view.camera.R_camera_world).norm(), 1e-12);
  EXPECT_LT((pose.translation() - view.camera.t_world_camera).norm(), 1e-12);
}

}  // namespace romap::slam::reprojection_cost_test
