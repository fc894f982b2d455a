#include "server/slam/motion_model.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "common/angles.h"

namespace romap::slam::motion_model_test {

constexpr int64_t kInterval_ns = 40'000'000;

SE3<World, Camera> Pose(double angle_rad, double x_mu) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitY())), {x_mu, 0.5, 0}};
}

Frame FrameAt(int64_t timestamp_ns) {
  Frame frame;
  frame.timestamp_ns = timestamp_ns;
  return frame;
}

void ExpectNear(const SE3<World, Camera>& pose, const SE3<World, Camera>& expected) {
  EXPECT_TRUE(pose.Matrix().isApprox(expected.Matrix(), 1e-9)) << pose.Matrix() << "\nexpected\n" << expected.Matrix();
}

// Two frames have been tracked: the camera moved from Pose(0.1, 1) to Pose(0.2, 1.3).
class MotionModelTest : public ::testing::Test {
 protected:
  MotionModelTest() {
    model_.Update(Pose(0.1, 1), {}, 0, /*is_continuous=*/true);
    model_.Update(Pose(0.2, 1.3), {}, kInterval_ns, /*is_continuous=*/true);
  }

  SE3<World, Camera> Predict(int64_t timestamp_ns) const {
    return model_.Predict(FrameAt(timestamp_ns), /*use_prior=*/false);
  }

  const SE3<Camera, Camera> motion_ = Pose(0.1, 1).Inverse() * Pose(0.2, 1.3);
  MotionModel model_;
};

TEST_F(MotionModelTest, PredictsConstantVelocity) { ExpectNear(Predict(2 * kInterval_ns), Pose(0.2, 1.3) * motion_); }

TEST_F(MotionModelTest, ScalesTheMotionWithTheTime) {
  const SE3<World, Camera> predicted = Predict(kInterval_ns + kInterval_ns / 2);
  EXPECT_NEAR(predicted.rotation().angularDistance(Pose(0.2, 0).rotation()), 0.05, 1e-9);
  ExpectNear(predicted, Pose(0.2, 1.3) * SE3<Camera, Camera>(Pose(0.05, 0).rotation(), 0.5 * motion_.translation()));
}

TEST_F(MotionModelTest, PredictsTheLastPoseIfTheMotionIsUnknown) {
  MotionModel one_frame;
  one_frame.Update(Pose(0.1, 1), {}, 0, /*is_continuous=*/true);
  ExpectNear(one_frame.Predict(FrameAt(kInterval_ns), /*use_prior=*/false), Pose(0.1, 1));

  ExpectNear(Predict(kInterval_ns + 300'000'000), Pose(0.2, 1.3));  // too long ago

  model_.ResetMotion();
  ExpectNear(Predict(2 * kInterval_ns), Pose(0.2, 1.3));
}

TEST_F(MotionModelTest, IgnoresTheMotionAcrossALoss) {
  model_.Update(Pose(0.9, 4), {}, 2 * kInterval_ns, /*is_continuous=*/false);
  ExpectNear(Predict(3 * kInterval_ns), Pose(0.9, 4));
}

TEST_F(MotionModelTest, UsesTheMotionBetweenClientPoses) {
  const SE3<World, Camera> first_prior = Pose(-0.4, 7);
  model_.Update(Pose(0.3, 1.5), first_prior, 2 * kInterval_ns, /*is_continuous=*/true);
  const SE3<Camera, Camera> prior_motion(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX())),
                                         Eigen::Vector3d(0.1, 0.2, 0.3));
  Frame frame = FrameAt(3 * kInterval_ns);
  frame.T_world_camera = first_prior * prior_motion;
  ExpectNear(model_.Predict(frame, /*use_prior=*/true), Pose(0.3, 1.5) * prior_motion);
  const SE3<Camera, Camera> last_motion = Pose(0.2, 1.3).Inverse() * Pose(0.3, 1.5);
  ExpectNear(model_.Predict(frame, /*use_prior=*/false), Pose(0.3, 1.5) * last_motion);
}

TEST_F(MotionModelTest, FollowsCorrectionsOfTheMap) {
  const ScaledPose before{Pose(0, 1), 1};
  const ScaledPose after{Pose(1.2, -3), 2};
  model_.Correct(before, after);
  const SE3<World, Camera> last_pose =
      Pose(1.2, -3) * ScaleTranslation(Pose(0, 1).Inverse() * Pose(0.2, 1.3), /*scale=*/2);
  ASSERT_TRUE(model_.last_pose());
  ExpectNear(*model_.last_pose(), last_pose);
  ExpectNear(Predict(2 * kInterval_ns), last_pose * ScaleTranslation(motion_, 2));
}

TEST_F(MotionModelTest, ResetDiscardsTheLastPose) {
  model_.Reset();
  EXPECT_FALSE(model_.last_pose());
  model_.Correct({Pose(0, 0), 1}, {Pose(1, 1), 1});
  EXPECT_FALSE(model_.last_pose());
}

TEST(IsPlausible, LimitsTheDistanceFromThePrediction) {
  const auto moved = [](double distance_mu, double angle_deg) {
    return SE3<World, Camera>(Eigen::Quaterniond(Eigen::AngleAxisd(angle_deg * kRadPerDeg, Eigen::Vector3d::UnitY())),
                              Eigen::Vector3d(0, distance_mu, 0));
  };
  EXPECT_TRUE(IsPlausible(moved(0, 0), moved(0.19, 7), /*depth_mu=*/2));
  EXPECT_FALSE(IsPlausible(moved(0, 0), moved(0.21, 0), /*depth_mu=*/2));
  EXPECT_FALSE(IsPlausible(moved(0, 0), moved(0, 9), /*depth_mu=*/2));
  EXPECT_TRUE(IsPlausible(moved(5, 40), moved(5.1, 43), /*depth_mu=*/2));
}

}  // namespace romap::slam::motion_model_test
