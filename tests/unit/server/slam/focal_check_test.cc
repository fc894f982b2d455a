#include "server/slam/focal_check.h"

#include <gmock/gmock.h>

#include <random>

#include "server/slam/optimize/lie.h"

namespace romap::slam::focal_check_test {

using ::testing::HasSubstr;

CameraModel TrueCamera() {
  return {.width_px = 640, .height_px = 480, .fx_px = 525, .fy_px = 525, .cx_px = 319.5, .cy_px = 239.5};
}

struct Fault {
  double focal_factor = 1;    // of the stated focal length
  double rotation_rad = 0;    // standard deviation of the stated rotation, per axis
  double noise_px = 0.5;      // of the matches
  double rotation_step = 10;  // [deg] between the frames of a pair
  double moving_share = 0;    // of the points, which move between the frames
};

// Pairs of frames of a camera that circles around points, three of each first frame.
FocalCheck CheckWith(const Fault& fault, int pairs = 18) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> normal(0, 1);
  CameraModel stated = TrueCamera();
  stated.fx_px *= fault.focal_factor;
  stated.fy_px *= fault.focal_factor;
  FocalCheck check;
  for (int i = 0; i < pairs; ++i) {
    // About the vertical axis, and a little about the horizontal one, as a camera held by hand.
    const double turn_rad = fault.rotation_step * EIGEN_PI / 180 * (1 + 0.3 * uniform(random));
    const Eigen::Quaterniond rotation = ExpRotation({0.25 * turn_rad * uniform(random), turn_rad, 0});
    const Eigen::Vector3d center(0, 0, 2.5);
    const SE3<Camera, Camera> T_second_first(rotation, center - rotation * center);
    PoseCheck::AgreeingPair pair{.first_frame_id = static_cast<uint64_t>(1 + i / 3 * 3), .matches = {}};
    while (pair.matches.size() < 150) {
      Eigen::Vector3d p_first(uniform(random), 0.7 * uniform(random), 2.5 + uniform(random));
      const Eigen::Vector2d first = TrueCamera().Project(p_first);
      if (static_cast<double>(pair.matches.size()) < 150 * fault.moving_share)
        p_first += Eigen::Vector3d(0.1, 0.1, 0.05);
      const Eigen::Vector2d second = TrueCamera().Project(T_second_first * p_first);
      const Eigen::Vector2d noise(normal(random), normal(random));
      pair.matches.push_back({first, second + fault.noise_px * noise, 1.0});
    }
    const Eigen::Vector3d error(normal(random), normal(random), normal(random));
    pair.T_second_first = {ExpRotation(fault.rotation_rad * error) * rotation, T_second_first.translation()};
    check.AddPair(stated, pair);
  }
  return check;
}

TEST(FocalCheckTest, NamesTheFocalLengthThatFits) {
  for (const double factor : {0.5, 0.67, 0.8, 1.25, 1.5, 2.0}) {
    const std::optional<Diagnostic> diagnostic = CheckWith({.focal_factor = factor}).Check();
    ASSERT_TRUE(diagnostic.has_value()) << factor;
    EXPECT_EQ(diagnostic->code, "calibration_contradicts_images");
    EXPECT_EQ(diagnostic->severity, Severity::kError);
    EXPECT_EQ(diagnostic->first_frame_id, 1u);
    const size_t about = diagnostic->advice.find("about ");
    ASSERT_NE(about, std::string::npos) << diagnostic->advice;
    EXPECT_NEAR(std::stod(diagnostic->advice.substr(about + 6)), 525, 0.1 * 525) << factor;
  }
}

TEST(FocalCheckTest, TheRightFocalLengthIsNotContradicted) {
  EXPECT_FALSE(CheckWith({}).IsContradicted());
  EXPECT_FALSE(CheckWith({.focal_factor = 1.06}).IsContradicted());
  EXPECT_FALSE(CheckWith({.noise_px = 1.5}).IsContradicted());
  EXPECT_FALSE(CheckWith({.rotation_step = 3}).IsContradicted());
  EXPECT_FALSE(CheckWith({.moving_share = 0.4}).IsContradicted());
}

TEST(FocalCheckTest, NoisyPosesAreNotContradicted) {
  for (const double rotation_rad : {0.001, 0.003, 0.01}) {
    EXPECT_FALSE(CheckWith({.rotation_rad = rotation_rad}).IsContradicted()) << rotation_rad;
    EXPECT_FALSE(CheckWith({.rotation_rad = rotation_rad, .rotation_step = 3}).IsContradicted()) << rotation_rad;
  }
}

// A camera that does not turn shows no focal length.
TEST(FocalCheckTest, SidewaysMotionGivesNoDecision) {
  EXPECT_FALSE(CheckWith({.focal_factor = 1.5, .rotation_step = 0.01}).IsContradicted());
}

TEST(FocalCheckTest, AFewPairsAreNotJudged) { EXPECT_FALSE(CheckWith({.focal_factor = 1.5}, 5).IsContradicted()); }

}  // namespace romap::slam::focal_check_test
