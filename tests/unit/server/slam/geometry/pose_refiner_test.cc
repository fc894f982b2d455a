#include "server/slam/geometry/pose_refiner.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "tests/unit/server/slam/geometry/synthetic_scene.h"

namespace romap::slam::pose_refiner_test {

struct Scene {
  CameraModel camera = TestCamera();
  SE3<World, Camera> T_world_camera{RotationXyz(20, -35, 10), {0.3, -1.2, 0.7}};
  std::vector<PoseObservation> observations;
};

Scene MakeScene(int count, double noise_px, uint64_t seed) {
  Scene scene;
  Noise noise(seed);
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d pixel_px = noise.Pixel(scene.camera);
    const Eigen::Vector3d p_camera = noise.Uniform(1, 5) * scene.camera.Unproject(pixel_px.x(), pixel_px.y());
    scene.observations.push_back({.p_world = scene.T_world_camera * p_camera,
                                  .pixel_px = pixel_px + noise.Normal2(noise_px),
                                  .sigma_px = noise_px > 0 ? noise_px : 1.0});
  }
  return scene;
}

// A pose near the true one.
SE3<World, Camera> Perturbed(const Scene& scene) {
  return scene.T_world_camera * SE3<Camera, Camera>(RotationXyz(2, -3, 2), {0.08, -0.05, 0.1});
}

double RotationError_deg(const Scene& scene, const PoseEstimate& estimate) {
  return AngleBetween_deg(scene.T_world_camera.rotation(), estimate.T_world_camera.rotation());
}
double TranslationError_mu(const Scene& scene, const PoseEstimate& estimate) {
  return (scene.T_world_camera.translation() - estimate.T_world_camera.translation()).norm();
}

TEST(PoseRefiner, FindsTheExactPoseFromExactPixels) {
  const Scene scene = MakeScene(50, 0, 1);
  const PoseEstimate estimate = RefinePose(scene.camera, Perturbed(scene), scene.observations);
  EXPECT_EQ(estimate.inliers, 50);
  EXPECT_LT(RotationError_deg(scene, estimate), 1e-4);
  EXPECT_LT(TranslationError_mu(scene, estimate), 1e-5);
  EXPECT_LT(estimate.rms_px, 1e-3);
}

TEST(PoseRefiner, RmsErrorMatchesThePixelNoise) {
  const Scene scene = MakeScene(2000, 0.8, 2);
  const PoseEstimate estimate = RefinePose(scene.camera, Perturbed(scene), scene.observations);
  EXPECT_NEAR(estimate.inliers, 0.95 * 2000, 40);
  // The 95 % bound removes the tail: E[chi2 | chi2 < 5.991] = 1.685 for two degrees of freedom.
  EXPECT_NEAR(estimate.rms_px, 0.8 * std::sqrt(1.685), 0.03);
  EXPECT_LT(RotationError_deg(scene, estimate), 0.05);
}

TEST(PoseRefiner, WrongMatchesAreOutliersAndDoNotBiasThePose) {
  Scene scene = MakeScene(400, 1, 3);
  Noise noise(33);
  for (int i = 0; i < 400; i += 3) scene.observations[i].pixel_px = noise.Pixel(scene.camera);
  const PoseEstimate estimate = RefinePose(scene.camera, Perturbed(scene), scene.observations);
  EXPECT_LT(RotationError_deg(scene, estimate), 0.15);
  EXPECT_LT(TranslationError_mu(scene, estimate), 0.01);
  int wrong_taken = 0;
  int right_taken = 0;
  for (int i = 0; i < 400; ++i) (i % 3 == 0 ? wrong_taken : right_taken) += estimate.inlier[i];
  EXPECT_LE(wrong_taken, 2);
  EXPECT_GE(right_taken, 240);
  EXPECT_EQ(wrong_taken + right_taken, estimate.inliers);
}

TEST(PoseRefiner, CloseStartToleratesAMajorityOfOutliers) {
  Scene scene = MakeScene(400, 1, 4);
  Noise noise(44);
  for (int i = 0; i < 280; ++i) scene.observations[i].pixel_px = noise.Pixel(scene.camera);
  const SE3<World, Camera> start =
      scene.T_world_camera * SE3<Camera, Camera>(RotationXyz(0.05, 0, 0.05), {0.002, 0, 0});
  const PoseEstimate estimate =
      RefinePose(scene.camera, start, scene.observations, {.rounds = 3, .start_is_close = true});
  EXPECT_LT(RotationError_deg(scene, estimate), 0.2);
  EXPECT_GE(estimate.inliers, 105);
}

TEST(PoseRefiner, DepthDeterminesTheDistance) {
  // A small, distant patch: the pixels hardly determine the distance.
  Scene scene = MakeScene(0, 1, 5);
  Noise noise(55);
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d p_camera(noise.Uniform(-0.05, 0.05), noise.Uniform(-0.05, 0.05), noise.Uniform(4.95, 5.05));
    scene.observations.push_back({.p_world = scene.T_world_camera * p_camera,
                                  .pixel_px = scene.camera.Project(p_camera) + noise.Normal2(1),
                                  .sigma_px = 1,
                                  .depth_mu = p_camera.z() + noise.Normal(0.01),
                                  .depth_sigma_mu = 0.01});
  }
  const auto along_mu = [&](const PoseEstimate& estimate) {
    return std::abs((scene.T_world_camera.Inverse() * estimate.T_world_camera).translation().z());
  };
  const PoseEstimate with_depth = RefinePose(scene.camera, scene.T_world_camera, scene.observations);
  EXPECT_LT(along_mu(with_depth), 0.01);
  for (PoseObservation& observation : scene.observations) observation.depth_mu = 0;
  const PoseEstimate without = RefinePose(scene.camera, scene.T_world_camera, scene.observations);
  EXPECT_GT(along_mu(without), along_mu(with_depth));
}

TEST(PoseRefiner, WrongDepthIsAnOutlier) {
  Scene scene = MakeScene(100, 0, 6);
  for (PoseObservation& observation : scene.observations) {
    observation.depth_mu = (scene.T_world_camera.Inverse() * observation.p_world).z();
    observation.depth_sigma_mu = 0.02;
  }
  scene.observations[7].depth_mu += 0.2;
  const PoseEstimate estimate = RefinePose(scene.camera, Perturbed(scene), scene.observations);
  EXPECT_EQ(estimate.inliers, 99);
  EXPECT_FALSE(estimate.inlier[7]);
}

TEST(PoseRefiner, TooFewUsableObservationsGiveNoInliers) {
  Scene scene = MakeScene(10, 0, 7);
  for (int i = 0; i < 7; ++i) {  // only three are usable; the others are invalid for three different reasons
    PoseObservation& observation = scene.observations[i];
    if (i % 3 == 0) observation.sigma_px = 0;
    if (i % 3 == 1) observation.p_world.x() = std::numeric_limits<double>::quiet_NaN();
    if (i % 3 == 2) observation.p_world = scene.T_world_camera * Eigen::Vector3d(0, 0, -1);
  }
  const PoseEstimate estimate = RefinePose(scene.camera, scene.T_world_camera, scene.observations);
  EXPECT_EQ(estimate.inliers, 0);
  EXPECT_EQ(estimate.inlier, std::vector<uint8_t>(10, 0));
  EXPECT_TRUE(estimate.T_world_camera.IsFinite());
  EXPECT_EQ(RefinePose(scene.camera, scene.T_world_camera, {}).inliers, 0);
}

TEST(PoseRefiner, ConvergesDespitePointsNearTheCameraPlane) {
  Scene scene = MakeScene(60, 0.5, 8);
  for (int i = 0; i < 6; ++i) {
    scene.observations[i].p_world = Perturbed(scene) * Eigen::Vector3d(0.1, 0.1, i % 2 == 0 ? 1e-9 : -1e-9);
  }
  const PoseEstimate estimate = RefinePose(scene.camera, Perturbed(scene), scene.observations);
  EXPECT_LT(RotationError_deg(scene, estimate), 0.3);
  EXPECT_GE(estimate.inliers, 45);
}

}  // namespace romap::slam::pose_refiner_test
