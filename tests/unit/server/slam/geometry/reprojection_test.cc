#include "server/slam/geometry/reprojection.h"

#include <gtest/gtest.h>

#include "tests/unit/server/slam/geometry/gradient_check.h"
#include "tests/unit/server/slam/geometry/synthetic_scene.h"

namespace romap::slam::reprojection_test {

class ReprojectionGradient : public testing::TestWithParam<PoseObservation> {};

TEST_P(ReprojectionGradient, AgreesWithFiniteDifferences) {
  const CameraModel camera = TestCamera();
  const CameraFromWorld pose{RotationXyz(10, -20, 5).toRotationMatrix(), {0.1, -0.2, 0.4}};
  const auto linearize = [&](const CameraFromWorld& at) {
    PoseEquations equations;
    AddObservation(camera, at, GetParam(), equations);
    return equations;
  };
  ASSERT_GT(linearize(pose).cost, 0);
  const auto move = [](const CameraFromWorld& at, const PoseEquations::Vector& step) { return ApplyStep(at, step); };
  ExpectGradientOfCost<6>(linearize, move, pose);
}

INSTANTIATE_TEST_SUITE_P(
    PixelsAndDepth, ReprojectionGradient,
    testing::Values(
        PoseObservation{.p_world = {0.3, -0.2, 2.0}, .pixel_px = {90, 325}, .sigma_px = 3},   // within Huber's bound
        PoseObservation{.p_world = {0.3, -0.2, 2.0}, .pixel_px = {120, 150}, .sigma_px = 1},  // beyond it
        PoseObservation{
            .p_world = {0.3, -0.2, 2.0}, .pixel_px = {91, 321}, .sigma_px = 5, .depth_mu = 2.4, .depth_sigma_mu = 0.2},
        PoseObservation{
            .p_world = {-0.6, 0.5, 3.0}, .pixel_px = {80, 60}, .sigma_px = 2, .depth_mu = 2, .depth_sigma_mu = 0.1}));

TEST(Reprojection, PointBehindTheCameraHasInfiniteError) {
  const PoseObservation behind{.p_world = {0, 0, -1}, .pixel_px = {319.5, 239.5}};
  EXPECT_FALSE(std::isfinite(ErrorOf(TestCamera(), CameraFromWorld{}, behind).chi2));
}

TEST(Reprojection, DepthRequiresAStandardDeviation) {
  EXPECT_FALSE(HasDepth({.depth_mu = 2, .depth_sigma_mu = 0}));
  EXPECT_FALSE(HasDepth({.depth_mu = 0, .depth_sigma_mu = 0.1}));
  EXPECT_TRUE(HasDepth({.depth_mu = 2, .depth_sigma_mu = 0.1}));
}

}  // namespace romap::slam::reprojection_test
