#include "server/slam/geometry/pnp.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "tests/unit/server/slam/geometry/synthetic_scene.h"

namespace romap::slam::pnp_test {

struct Scene {
  CameraModel camera = TestCamera();
  SE3<World, Camera> T_world_camera{RotationXyz(-70, 15, 120), {3, -2, 1.5}};
  std::vector<PoseObservation> observations;
};

// `wrong_share`: share of the observations at random pixels. `flat`: all points are on one plane.
Scene MakeScene(int count, double wrong_share, bool flat, uint64_t seed) {
  Scene scene;
  Noise noise(seed);
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d pixel_px = noise.Pixel(scene.camera);
    const Eigen::Vector3d ray = scene.camera.Unproject(pixel_px.x(), pixel_px.y());
    const double depth = flat ? 2 / (1 + 0.5 * ray.y()) : noise.Uniform(1, 5);
    const bool is_wrong = noise.Uniform(0, 1) < wrong_share;
    scene.observations.push_back(
        {.p_world = scene.T_world_camera * (depth * ray),
         .pixel_px = is_wrong ? noise.Pixel(scene.camera) : Eigen::Vector2d(pixel_px + noise.Normal2(1)),
         .sigma_px = 1});
  }
  return scene;
}

void ExpectPose(const Scene& scene, const std::optional<PoseEstimate>& estimate) {
  ASSERT_TRUE(estimate.has_value());
  EXPECT_LT(AngleBetween_deg(scene.T_world_camera.rotation(), estimate->T_world_camera.rotation()), 0.5);
  EXPECT_LT((scene.T_world_camera.translation() - estimate->T_world_camera.translation()).norm(), 0.03);
}

TEST(Pnp, FindsThePoseWithoutPrior) {
  const Scene scene = MakeScene(100, 0, false, 1);
  ExpectPose(scene, SolvePnp(scene.camera, scene.observations, {}));
}

TEST(Pnp, ToleratesSeventyPercentOutliers) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    for (const bool flat : {false, true}) {
      const Scene scene = MakeScene(200, 0.7, flat, seed);
      const std::optional<PoseEstimate> estimate = SolvePnp(scene.camera, scene.observations, {});
      ExpectPose(scene, estimate);
      EXPECT_GT(estimate->inliers, 45);
      EXPECT_LT(estimate->inliers, 75);
    }
  }
}

TEST(Pnp, RejectsRandomMatches) {
  const Scene scene = MakeScene(200, 1, false, 2);
  EXPECT_FALSE(SolvePnp(scene.camera, scene.observations, {}).has_value());
}

TEST(Pnp, RejectsTooFewObservations) {
  const Scene scene = MakeScene(14, 0, false, 3);
  EXPECT_FALSE(SolvePnp(scene.camera, scene.observations, {}).has_value());
  EXPECT_TRUE(SolvePnp(scene.camera, scene.observations, {.min_inliers = 8}).has_value());
  EXPECT_FALSE(SolvePnp(scene.camera, {}, {.min_inliers = 0}).has_value());
}

TEST(Pnp, IgnoresInvalidObservations) {
  Scene scene = MakeScene(60, 0, false, 4);
  scene.observations[0].p_world.y() = std::numeric_limits<double>::quiet_NaN();
  scene.observations[1].sigma_px = 0;
  scene.observations[2].p_world = scene.observations[3].p_world;  // two observations of one point
  const std::optional<PoseEstimate> estimate = SolvePnp(scene.camera, scene.observations, {});
  ExpectPose(scene, estimate);
  EXPECT_FALSE(estimate->inlier[0]);
  EXPECT_FALSE(estimate->inlier[1]);
}

TEST(Pnp, NeverReturnsAnInfinitePoseForCollinearPoints) {
  Scene scene = MakeScene(30, 0, false, 5);
  for (int i = 0; i < 30; ++i) {
    const Eigen::Vector3d p_camera(0.05 * i - 0.7, 0, 3);
    scene.observations[i].p_world = scene.T_world_camera * p_camera;
    scene.observations[i].pixel_px = scene.camera.Project(p_camera);
  }
  const std::optional<PoseEstimate> estimate = SolvePnp(scene.camera, scene.observations, {});
  EXPECT_TRUE(!estimate || estimate->T_world_camera.IsFinite());
}

TEST(Pnp, IsDeterministicForASeed) {
  const Scene scene = MakeScene(150, 0.5, false, 6);
  const std::optional<PoseEstimate> once = SolvePnp(scene.camera, scene.observations, {.seed = 9});
  const std::optional<PoseEstimate> again = SolvePnp(scene.camera, scene.observations, {.seed = 9});
  ASSERT_TRUE(once && again);
  EXPECT_EQ(once->T_world_camera.Matrix(), again->T_world_camera.Matrix());
  EXPECT_EQ(once->inlier, again->inlier);
}

}  // namespace romap::slam::pnp_test
