#include "server/slam/distortion_check.h"

#include <gtest/gtest.h>

#include <random>

#include "common/lens.h"
#include "server/slam/optimize/lie.h"

namespace romap::slam::distortion_check_test {

CameraModel CameraWith(double k1) {
  return {.width_px = 640,
          .height_px = 480,
          .fx_px = 525,
          .fy_px = 525,
          .cx_px = 319.5,
          .cy_px = 239.5,
          .distortion = {k1, 0, 0, 0, 0}};
}

// Pairs of frames, three of each first frame, of a camera with distortion `true_k1` that circles around points.
DistortionCheck CheckWith(double stated_k1, double true_k1, double rotation_sigma_rad = 0, int pairs = 18) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> normal(0, 1);
  const CameraModel stated = CameraWith(stated_k1);
  DistortionCheck check;
  const auto pixel = [&](const Eigen::Vector3d& p_camera) -> Eigen::Vector2d {
    const Eigen::Vector2d in_image = ProjectDistorted(CameraWith(true_k1), p_camera);
    const std::vector<Eigen::Vector2f> as_vector{
        (in_image + 0.5 * Eigen::Vector2d(normal(random), normal(random))).cast<float>()};
    return UndistortPixels(stated, as_vector).front().cast<double>();
  };
  for (int i = 0; i < pairs; ++i) {
    const double turn_rad = 0.17 * (1 + 0.3 * uniform(random));
    const Eigen::Quaterniond rotation = ExpRotation({0.25 * turn_rad * uniform(random), turn_rad, 0});
    const Eigen::Vector3d center(0, 0, 2.5);
    const SE3<Camera, Camera> T_second_first(rotation, center - rotation * center);
    PoseCheck::AgreeingPair pair{.first_frame_id = static_cast<uint64_t>(1 + i / 3 * 3), .matches = {}};
    while (pair.matches.size() < 150) {
      const Eigen::Vector3d p_first(1.2 * uniform(random), uniform(random), 2.5 + uniform(random));
      const TwoViewMatch match{pixel(p_first), pixel(T_second_first * p_first), 1.0};
      if (match.first_px.allFinite() && match.second_px.allFinite()) pair.matches.push_back(match);
    }
    const Eigen::Vector3d error(normal(random), normal(random), normal(random));
    pair.T_second_first = {ExpRotation(rotation_sigma_rad * error) * rotation, T_second_first.translation()};
    check.AddPair(stated, pair);
  }
  return check;
}

TEST(DistortionCheckTest, NamesADistortionThatTheImagesDoNotHave) {
  for (const double k1 : {-0.4, -0.25, 0.4}) {
    const DistortionCheck check = CheckWith(k1, 0);
    ASSERT_TRUE(check.IsContradicted()) << k1;
    EXPECT_EQ(check.contradicted_since_frame(), 1u);
    EXPECT_EQ(check.Check()->code, "calibration_contradicts_images");
    EXPECT_EQ(check.Check()->severity, Severity::kError);
    EXPECT_NE(check.Check()->advice.find("state no distortion"), std::string::npos);
  }
}

TEST(DistortionCheckTest, TheRightDistortionIsNotContradicted) {
  for (const double k1 : {-0.4, -0.1, 0.25}) {
    for (const double rotation_sigma_rad : {0.0, 0.003, 0.01}) {
      EXPECT_FALSE(CheckWith(k1, k1, rotation_sigma_rad).IsContradicted()) << k1 << " " << rotation_sigma_rad;
      EXPECT_FALSE(CheckWith(k1, 0.8 * k1, rotation_sigma_rad).IsContradicted()) << k1 << " " << rotation_sigma_rad;
    }
  }
}

TEST(DistortionCheckTest, AFewPairsAreNotJudged) { EXPECT_FALSE(CheckWith(-0.4, 0, 0, 5).IsContradicted()); }

}  // namespace romap::slam::distortion_check_test
