#include "server/slam/geometry/two_view.h"

#include <gtest/gtest.h>

#include <functional>
#include <vector>

#include "common/angles.h"
#include "common/statistics.h"
#include "tests/unit/server/slam/geometry/synthetic_scene.h"

namespace romap::slam::two_view_test {

// The z depth at which a ray (z = 1) of the first camera intersects the scene.
using Surface = std::function<double(const Eigen::Vector3d& ray, Noise& noise)>;

// Boxes and walls at depths between 1 and 4 units.
double Clutter(const Eigen::Vector3d&, Noise& noise) { return noise.Uniform(1, 4); }
// A plane tilted by 35 degrees, 2 units away in the middle of the image.
double TiltedDesk(const Eigen::Vector3d& ray, Noise&) { return 2 / (1 + std::tan(35 * kRadPerDeg) * ray.y()); }
// The same desk with objects up to 0.3 units high on a third of it.
double DeskWithObjects(const Eigen::Vector3d& ray, Noise& noise) {
  const double desk = TiltedDesk(ray, noise);
  return noise.Uniform(0, 3) < 1 ? desk - noise.Uniform(0.05, 0.3) : desk;
}
double DeskFromAbove(const Eigen::Vector3d&, Noise&) { return 1.5; }

struct Scene {
  CameraModel camera = TestCamera();
  SE3<Camera, Camera> T_first_second;
  std::vector<TwoViewMatch> matches;
  std::vector<double> depths;  // true, in the first camera; 0 for a wrong match
};

struct SceneOptions {
  int count = 300;
  double noise_px = 0.7;
  double outlier_share = 0;
  uint64_t seed = 1;
};

Scene MakeScene(const Surface& surface, const SE3<Camera, Camera>& T_first_second, const SceneOptions& options) {
  Scene scene;
  scene.T_first_second = T_first_second;
  Noise noise(options.seed);
  while (static_cast<int>(scene.matches.size()) < options.count) {
    const Eigen::Vector2d first_px = noise.Pixel(scene.camera);
    const Eigen::Vector3d ray = scene.camera.Unproject(first_px.x(), first_px.y());
    const double depth = surface(ray, noise);
    const Eigen::Vector3d p_second = T_first_second.Inverse() * (depth * ray);
    if (!IsInImage(scene.camera, p_second)) continue;
    const bool is_wrong = noise.Uniform(0, 1) < options.outlier_share;
    const Eigen::Vector2d second_px = is_wrong ? noise.Pixel(scene.camera) : scene.camera.Project(p_second);
    scene.matches.push_back({.first_px = first_px + noise.Normal2(options.noise_px),
                             .second_px = second_px + noise.Normal2(options.noise_px),
                             .sigma_px = 1});
    scene.depths.push_back(is_wrong ? 0 : depth);
  }
  return scene;
}

TwoViewResult Solve(const Scene& scene, const TwoViewOptions& options = {}) {
  return SolveTwoView(scene.camera, scene.matches, options);
}

double RotationError_deg(const Scene& scene, const TwoViewResult& result) {
  return AngleBetween_deg(scene.T_first_second.rotation(), result.T_first_second.rotation());
}
double DirectionError_deg(const Scene& scene, const TwoViewResult& result) {
  return AngleBetween_deg(scene.T_first_second.translation(), result.T_first_second.translation());
}

void ExpectAccurate(const Scene& scene, const TwoViewResult& result) {
  ASSERT_EQ(result.outcome, TwoViewOutcome::kOk) << Describe(result.outcome);
  EXPECT_LT(RotationError_deg(scene, result), 1.0);
  EXPECT_LT(DirectionError_deg(scene, result), 6.0);
  EXPECT_NEAR(result.T_first_second.translation().norm(), 1, 1e-9);
}

const SE3<Camera, Camera> kSideways(RotationXyz(1, -4, 2), {0.3, 0.02, -0.03});
const SE3<Camera, Camera> kForward(RotationXyz(1, 1, 2), {0.03, 0.02, 0.5});

TEST(TwoView, FindsTheMotionInAClutteredScene) {
  const Scene scene = MakeScene(Clutter, kSideways, {});
  const TwoViewResult result = Solve(scene);
  ExpectAccurate(scene, result);
  EXPECT_FALSE(result.from_homography);
  EXPECT_GT(result.points, 240);
  EXPECT_GT(result.parallax_rad, 4 * kRadPerDeg);
}

TEST(TwoView, FindsForwardMotion) {
  const Scene scene = MakeScene(Clutter, kForward, {});
  ExpectAccurate(scene, Solve(scene));
}

TEST(TwoView, FindsTheMotionAboveADesk) {
  const Scene scene = MakeScene(DeskFromAbove, kSideways, {});
  const TwoViewResult result = Solve(scene);
  ExpectAccurate(scene, result);
  EXPECT_TRUE(result.from_homography);
}

TEST(TwoView, FindsTheMotionAboveADeskWithObjects) {
  const Scene scene = MakeScene(DeskWithObjects, kSideways, {.noise_px = 0.5});
  ExpectAccurate(scene, Solve(scene));
}

TEST(TwoView, ToleratesFortyPercentOutliers) {
  for (const Surface& surface : {Surface(Clutter), Surface(DeskFromAbove)}) {
    const Scene scene = MakeScene(surface, kSideways, {.count = 400, .noise_px = 1, .outlier_share = 0.4, .seed = 5});
    const TwoViewResult result = Solve(scene);
    ExpectAccurate(scene, result);
    int wrong_points = 0;
    for (size_t i = 0; i < scene.matches.size(); ++i) {
      wrong_points += scene.depths[i] == 0 && result.points_first[i].has_value();
    }
    EXPECT_LT(wrong_points, 12);
  }
}

TEST(TwoView, TriangulatesAccuratePoints) {
  const Scene scene = MakeScene(Clutter, kSideways, {.noise_px = 0.3});
  const TwoViewResult result = Solve(scene);
  ASSERT_EQ(result.outcome, TwoViewOutcome::kOk);
  const double unit = scene.T_first_second.translation().norm();
  std::vector<double> errors;
  int points = 0;
  for (size_t i = 0; i < scene.matches.size(); ++i) {
    if (!result.points_first[i]) continue;
    ++points;
    errors.push_back(std::abs(result.points_first[i]->z() * unit / scene.depths[i] - 1));
    EXPECT_LT((scene.camera.Project(*result.points_first[i]) - scene.matches[i].first_px).norm(), 2);
  }
  EXPECT_EQ(points, result.points);
  EXPECT_LT(Median(errors), 0.03);
  EXPECT_LT(NearestQuantile(errors, 0.9), 0.1);
}

TEST(TwoView, RejectsPureRotation) {
  for (const Surface& surface : {Surface(Clutter), Surface(DeskFromAbove)}) {
    for (uint64_t seed = 1; seed <= 5; ++seed) {
      const Scene scene = MakeScene(surface, {RotationXyz(3, -8, 4), {0, 0, 0}}, {.outlier_share = 0.2, .seed = seed});
      EXPECT_EQ(Solve(scene).outcome, TwoViewOutcome::kTooLittleParallax) << "seed " << seed;
    }
  }
}

TEST(TwoView, RejectsAStationaryCamera) {
  const Scene still = MakeScene(Clutter, {}, {.seed = 3});
  EXPECT_EQ(Solve(still).outcome, TwoViewOutcome::kTooLittleParallax);
  const Scene exactly_still = MakeScene(Clutter, {}, {.noise_px = 0});
  EXPECT_EQ(Solve(exactly_still).outcome, TwoViewOutcome::kTooLittleParallax);
}

TEST(TwoView, RejectsParallaxOfOnlyAFewNearPoints) {
  const Surface mostly_distant = [](const Eigen::Vector3d&, Noise& noise) {
    return noise.Uniform(0, 1) < 0.2 ? noise.Uniform(1, 2) : noise.Uniform(15, 30);
  };
  const Scene scene = MakeScene(mostly_distant, {RotationXyz(0, 1, 0), {0.12, 0, 0}}, {});
  EXPECT_EQ(Solve(scene).outcome, TwoViewOutcome::kTooLittleParallax);
}

TEST(TwoView, ObliqueMotionTowardAPlaneIsAmbiguous) {
  // The camera moves obliquely toward a tilted plane. The second solution also has all points in front of both cameras.
  const Scene scene = MakeScene(TiltedDesk, {RotationXyz(0, 2, 0), {0.02, 0.15, 0.3}}, {.noise_px = 0.5});
  EXPECT_EQ(Solve(scene).outcome, TwoViewOutcome::kAmbiguous);
}

TEST(TwoView, RejectsTooFewMatches) {
  EXPECT_EQ(SolveTwoView(TestCamera(), {}, {}).outcome, TwoViewOutcome::kTooFewMatches);
  const Scene few = MakeScene(Clutter, kSideways, {.count = 79});
  const TwoViewResult result = Solve(few);
  EXPECT_EQ(result.outcome, TwoViewOutcome::kTooFewMatches);
  EXPECT_EQ(result.points_first.size(), 79u);
}

TEST(TwoView, RejectsMatchesWithoutACommonMotion) {
  const Scene random_matches = MakeScene(Clutter, kSideways, {.count = 150, .outlier_share = 1});
  EXPECT_NE(Solve(random_matches).outcome, TwoViewOutcome::kOk);
}

TEST(TwoView, IsDeterministicForASeed) {
  const Scene scene = MakeScene(DeskWithObjects, kForward, {.outlier_share = 0.3});
  const TwoViewResult once = Solve(scene);
  const TwoViewResult again = Solve(scene);
  EXPECT_EQ(once.outcome, again.outcome);
  EXPECT_EQ(once.T_first_second.Matrix(), again.T_first_second.Matrix());
  EXPECT_EQ(once.points, again.points);
}

TEST(TwoView, NeverReturnsAWrongMotion) {
  int found = 0;
  int tried = 0;
  std::vector<double> rotation_errors_deg;
  Noise noise(77);
  for (const Surface& surface :
       {Surface(Clutter), Surface(TiltedDesk), Surface(DeskWithObjects), Surface(DeskFromAbove)}) {
    for (uint64_t seed = 1; seed <= 12; ++seed) {
      const Eigen::Vector3d shift = noise.Uniform(0.02, 0.5) * noise.Normal3(1).normalized();
      const SE3<Camera, Camera> motion(RotationXyz(noise.Uniform(-5, 5), noise.Uniform(-5, 5), noise.Uniform(-10, 10)),
                                       shift);
      const Scene scene =
          MakeScene(surface, motion, {.count = 200, .outlier_share = noise.Uniform(0, 0.4), .seed = seed});
      const TwoViewResult result = Solve(scene);
      ++tried;
      if (result.outcome != TwoViewOutcome::kOk) continue;
      ++found;
      rotation_errors_deg.push_back(RotationError_deg(scene, result));
      EXPECT_LT(RotationError_deg(scene, result), 3) << "seed " << seed;
      EXPECT_LT(DirectionError_deg(scene, result), 20) << "seed " << seed;
    }
  }
  EXPECT_GT(found, tried / 3);
  EXPECT_LT(Median(rotation_errors_deg), 0.5);
}

}  // namespace romap::slam::two_view_test
