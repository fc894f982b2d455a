#include "server/slam/geometry/similarity.h"

#include <gtest/gtest.h>

#include <vector>

#include "server/slam/geometry/similarity_equations.h"
#include "tests/unit/server/slam/geometry/gradient_check.h"
#include "tests/unit/server/slam/geometry/synthetic_scene.h"

namespace romap::slam::similarity_test {

const Sim3<Camera, Camera> kTruth(1.6, RotationXyz(12, -20, 5), {0.4, -0.1, 0.3});

struct Scene {
  CameraModel camera = TestCamera();
  std::vector<SimilarityMatch> matches;
};

// Points visible to both cameras, with a position in the map of each camera. `depth_noise`: standard deviation of a
// position along its ray, as a share of the distance.
Scene MakeScene(const Sim3<Camera, Camera>& S_first_second, int count, double depth_noise, double wrong_share,
                uint64_t seed) {
  Scene scene;
  Noise noise(seed);
  while (static_cast<int>(scene.matches.size()) < count) {
    const Eigen::Vector2d second_px = noise.Pixel(scene.camera);
    const Eigen::Vector3d p_second = noise.Uniform(1, 4) * scene.camera.Unproject(second_px.x(), second_px.y());
    Eigen::Vector3d p_first = S_first_second * p_second;
    if (!IsInImage(scene.camera, p_first)) continue;
    Eigen::Vector2d first_px = scene.camera.Project(p_first);
    if (noise.Uniform(0, 1) < wrong_share) {
      first_px = noise.Pixel(scene.camera);
      p_first = noise.Uniform(1, 6) * scene.camera.Unproject(first_px.x(), first_px.y());
    }
    scene.matches.push_back({.p_first = (1 + noise.Normal(depth_noise)) * p_first,
                             .p_second = (1 + noise.Normal(depth_noise)) * p_second,
                             .first_px = first_px + noise.Normal2(1),
                             .second_px = second_px + noise.Normal2(1)});
  }
  return scene;
}

TEST(AlignPoints, FindsTheExactSimilarity) {
  Noise noise(1);
  std::vector<Eigen::Vector3d> p_from;
  std::vector<Eigen::Vector3d> p_to;
  for (int i = 0; i < 3; ++i) {
    p_from.push_back(noise.Normal3(1));
    p_to.push_back(kTruth * p_from.back());
  }
  const auto S = AlignPoints<Camera, Camera>(p_from, p_to, false);
  ASSERT_TRUE(S.has_value());
  EXPECT_NEAR(S->scale(), kTruth.scale(), 1e-9);
  EXPECT_LT(AngleBetween_deg(S->rotation(), kTruth.rotation()), 1e-6);
  EXPECT_LT((S->translation() - kTruth.translation()).norm(), 1e-9);
}

TEST(AlignPoints, FixedScaleIsOne) {
  Noise noise(2);
  std::vector<Eigen::Vector3d> p_from;
  std::vector<Eigen::Vector3d> p_to;
  for (int i = 0; i < 50; ++i) {
    p_from.push_back(noise.Normal3(1));
    p_to.push_back(1.1 * (kTruth.rotation() * p_from.back()) + kTruth.translation());
  }
  const auto S = AlignPoints<World, Camera>(p_from, p_to, true);
  ASSERT_TRUE(S.has_value());
  EXPECT_EQ(S->scale(), 1);
  EXPECT_LT(AngleBetween_deg(S->rotation(), kTruth.rotation()), 1e-6);
}

TEST(AlignPoints, MirroredPointsDoNotGiveAReflection) {
  Noise noise(3);
  std::vector<Eigen::Vector3d> p_from;
  std::vector<Eigen::Vector3d> p_to;
  for (int i = 0; i < 20; ++i) {
    p_from.push_back(noise.Normal3(1));
    p_to.push_back(p_from.back().cwiseProduct(Eigen::Vector3d(1, 1, -1)));
  }
  const auto alignment = AlignPointSets(p_from, p_to, false);
  ASSERT_TRUE(alignment.has_value());
  EXPECT_NEAR(alignment->rotation.determinant(), 1, 1e-9);
}

TEST(AlignPoints, RejectsPointsThatDoNotDetermineARotation) {
  const std::vector<Eigen::Vector3d> two{{0, 0, 1}, {1, 0, 1}};
  const std::vector<Eigen::Vector3d> line{{0, 0, 1}, {1, 0, 1}, {2, 0, 1}, {3, 0, 1}};
  const std::vector<Eigen::Vector3d> same(5, Eigen::Vector3d(1, 2, 3));
  const std::vector<Eigen::Vector3d> plane{{0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};
  EXPECT_FALSE((AlignPoints<Camera, Camera>(two, two, false)));
  EXPECT_FALSE((AlignPoints<Camera, Camera>(line, line, false)));
  EXPECT_FALSE((AlignPoints<Camera, Camera>(same, same, false)));
  EXPECT_FALSE((AlignPoints<Camera, Camera>(plane, two, false)));
  EXPECT_TRUE((AlignPoints<Camera, Camera>(plane, plane, false)));
}

TEST(Similarity, ToleratesNoisyDepthsAndHalfOutliers) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const Scene scene = MakeScene(kTruth, 150, 0.02, 0.5, seed);
    const auto estimate = SolveSimilarity(scene.camera, scene.matches, {});
    ASSERT_TRUE(estimate.has_value());
    EXPECT_NEAR(estimate->S_first_second.scale(), kTruth.scale(), 0.03 * kTruth.scale());
    EXPECT_LT(AngleBetween_deg(estimate->S_first_second.rotation(), kTruth.rotation()), 0.7);
    EXPECT_LT((estimate->S_first_second.translation() - kTruth.translation()).norm(), 0.06);
    EXPECT_GT(estimate->inliers, 50);
    EXPECT_LT(estimate->inliers, 95);
  }
}

TEST(Similarity, FixedScaleIsOne) {
  const Sim3<Camera, Camera> rigid(1, kTruth.rotation(), kTruth.translation());
  const Scene scene = MakeScene(rigid, 100, 0.01, 0.3, 7);
  const auto estimate = SolveSimilarity(scene.camera, scene.matches, {.fix_scale = true});
  ASSERT_TRUE(estimate.has_value());
  EXPECT_EQ(estimate->S_first_second.scale(), 1);
  EXPECT_LT(AngleBetween_deg(estimate->S_first_second.rotation(), kTruth.rotation()), 0.5);
}

TEST(Similarity, RejectsRandomMatches) {
  const Scene scene = MakeScene(kTruth, 150, 0.02, 1, 8);
  EXPECT_FALSE(SolveSimilarity(scene.camera, scene.matches, {}).has_value());
  EXPECT_FALSE(SolveSimilarity(scene.camera, {}, {}).has_value());
}

TEST(Similarity, RefinementConvergesFromANearbyStart) {
  const Scene scene = MakeScene(kTruth, 200, 0, 0, 9);
  const Sim3<Camera, Camera> start(1.005 * kTruth.scale(), RotationXyz(0.2, 0, 0.1) * kTruth.rotation(),
                                   kTruth.translation() + Eigen::Vector3d(0.005, 0, 0));
  const SimilarityEstimate estimate = RefineSimilarity(scene.camera, start, scene.matches, {});
  EXPECT_GT(estimate.inliers, 190);
  EXPECT_EQ(estimate.inlier.size(), 200u);
  EXPECT_NEAR(estimate.S_first_second.scale(), kTruth.scale(), 0.005);
  EXPECT_LT(AngleBetween_deg(estimate.S_first_second.rotation(), kTruth.rotation()), 0.1);
}

TEST(Similarity, IsDeterministicForASeed) {
  const Scene scene = MakeScene(kTruth, 100, 0.02, 0.4, 10);
  const auto once = SolveSimilarity(scene.camera, scene.matches, {});
  const auto again = SolveSimilarity(scene.camera, scene.matches, {});
  ASSERT_TRUE(once && again);
  EXPECT_EQ(once->S_first_second.scale(), again->S_first_second.scale());
  EXPECT_EQ(once->inlier, again->inlier);
}

TEST(Similarity, GradientAgreesWithFiniteDifferences) {
  const Similarity near_truth{1.05 * kTruth.scale(), (RotationXyz(1, -1, 2) * kTruth.rotation()).toRotationMatrix(),
                              kTruth.translation() + Eigen::Vector3d(0.02, 0.01, -0.03)};
  for (const double chi2_bound : {9.21, 1e6}) {  // beyond Huber's bound, within it
    const Scene scene = MakeScene(kTruth, 5, 0.01, 0, 11);
    const SimilarityOptions options{.chi2_bound = chi2_bound};
    const auto linearize = [&](const Similarity& at) {
      SimilarityEquations equations;
      for (const SimilarityMatch& match : scene.matches) {
        AddSimilarityErrors(scene.camera, at, match, options, equations);
      }
      return equations;
    };
    ExpectGradientOfCost<7>(linearize, ApplySimilarityStep, near_truth);
  }
}

}  // namespace romap::slam::similarity_test
