#include "server/session/trajectory.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "common/angles.h"

namespace romap::session::trajectory_test {

constexpr KeyframeId kFirst{1};
constexpr KeyframeId kSecond{2};

SE3<World, Camera> At(double x_mu, double angle_deg = 0) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle_deg * kRadPerDeg, Eigen::Vector3d::UnitY())), {x_mu, 0, 0}};
}

// Of a camera at `x_mu`, as tracked against a keyframe at 0.
SE3<Camera, Camera> From0(double x_mu) { return {Eigen::Quaterniond::Identity(), {x_mu, 0, 0}}; }

KeyframeCorrection Moved(KeyframeId id, const SE3<World, Camera>& pose, double scale = 1) {
  return {.id = id, .T_world_camera = pose, .S_new_old = Sim3<World, World>(scale, {1, 0, 0, 0}, {0, 0, 0})};
}

class TrajectoryTest : public ::testing::Test {
 protected:
  // Keyframe 1 at 0, frames at 1, 2 and 3, all tracked against it.
  void SetUp() override {
    trajectory_.SetKeyframe(1, 0, kFirst, At(0));
    for (int i = 1; i <= 3; ++i) trajectory_.Add({1 + static_cast<uint64_t>(i), 10 * i, At(i), kFirst, From0(i)});
  }

  void Correct(const KeyframeCorrection& keyframe) {
    MapCorrection correction;
    correction.keyframes = {keyframe};
    trajectory_.Correct(correction);
  }

  Eigen::Vector3d Position(size_t frame) const { return trajectory_.Poses().at(frame).translation(); }

  Trajectory trajectory_;
};

TEST_F(TrajectoryTest, FramesHaveTheirTrackedPoses) {
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(Position(i).x(), 1 + static_cast<double>(i), 1e-9);
}

// As the frames of a stored trajectory are.
TEST(StoredTrajectoryTest, FramesWithoutReferenceKeepTheirUncertainty) {
  Trajectory trajectory;
  for (int i = 1; i <= 3; ++i) {
    trajectory.Add({.frame_id = static_cast<uint64_t>(i),
                    .timestamp_ns = 10 * i,
                    .T_world_camera = At(i),
                    .uncertainty = PoseUncertainty{.position_sigma_mu = 0.1 * i, .rotation_sigma_rad = 0.01}});
  }
  const auto uncertainties = trajectory.Uncertainties();
  ASSERT_EQ(uncertainties.size(), 3u);
  EXPECT_DOUBLE_EQ(uncertainties[2]->position_sigma_mu, 0.1 * 3);
}

TEST_F(TrajectoryTest, FramesMoveWithTheirReference) {
  Correct(Moved(kFirst, At(5), 2));
  EXPECT_NEAR(Position(0).x(), 7, 1e-9) << "the map was scaled by two";
  EXPECT_NEAR(Position(2).x(), 11, 1e-9);
}

TEST_F(TrajectoryTest, AKeyframeHasThePoseOfTheMap) {
  trajectory_.SetKeyframe(4, 30, kSecond, At(3.3, 4));
  EXPECT_NEAR(Position(2).x(), 3.3, 1e-9);
  Correct(Moved(kSecond, At(3.6)));
  EXPECT_NEAR(Position(2).x(), 3.6, 1e-9);
}

TEST_F(TrajectoryTest, FramesBetweenKeyframesShareTheCorrectionByTime) {
  trajectory_.SetKeyframe(4, 30, kSecond, At(3.3));
  EXPECT_NEAR(Position(0).x(), 1.1, 1e-9);
  EXPECT_NEAR(Position(1).x(), 2.2, 1e-9);
  trajectory_.Add({5, 40, At(4), kFirst, From0(4)});
  EXPECT_NEAR(Position(3).x(), 4.3, 1e-9) << "after the last keyframe";
}

TEST_F(TrajectoryTest, FramesOfTheNextReferenceAreNotCorrectedByIt) {
  trajectory_.SetKeyframe(4, 30, kSecond, At(3.3));
  trajectory_.Add({5, 40, At(4.3), kSecond, From0(1)});
  EXPECT_NEAR(Position(3).x(), 4.3, 1e-9);
}

TEST_F(TrajectoryTest, UncertaintiesHaveTheUnitOfTheCorrectedMap) {
  trajectory_.Add({5, 40, At(4), kFirst, From0(4), PoseUncertainty{0.5, 0.1}, PoseUncertainty{0, 0.01}});
  Correct(Moved(kFirst, At(0), 2));
  EXPECT_NEAR(trajectory_.Uncertainties().at(3)->position_sigma_mu, 1, 1e-9) << "as tracked, in the new unit";

  MapCorrection adjusted;
  adjusted.uncertainties = {{kFirst, PoseUncertainty{0.3, 0.1}}};
  trajectory_.Correct(adjusted);
  EXPECT_NEAR(trajectory_.Uncertainties().at(3)->position_sigma_mu, 0.3, 1e-9);
  Correct(Moved(kFirst, At(0), 3));
  EXPECT_NEAR(trajectory_.Uncertainties().at(3)->position_sigma_mu, 0.9, 1e-9);
  EXPECT_FALSE(trajectory_.Uncertainties().at(0)) << "added without";
}

TEST_F(TrajectoryTest, GivenPosesStay) {
  trajectory_.Add({5, 40, At(9), {}, {}});
  Correct(Moved(kFirst, At(5)));
  EXPECT_NEAR(Position(3).x(), 9, 1e-9);
}

TEST_F(TrajectoryTest, AKeyframeOfAnUnknownFrameIsKnownAsReference) {
  trajectory_.SetKeyframe(99, 5, kSecond, At(0.5));
  trajectory_.Add({5, 40, At(9), kSecond, From0(1)});
  EXPECT_NEAR(Position(3).x(), 1.5, 1e-9);
}

}  // namespace romap::session::trajectory_test
