#include "server/slam/loop_trial.h"

#include <gtest/gtest.h>

#include "tests/unit/server/slam/loop_world.h"

namespace romap::slam::loop_trial_test {

class LoopTrialTest : public ::testing::Test {
 protected:
  LoopTrialTest() : loop_(*LoopDetector(SlamConfig{}, &world_.map(), &world_.places()).Find(world_.newest(), true)) {}

  LoopTrial::Verdict Try(const LoopMatch& loop, bool run_inline = true) {
    LoopTrial trial(SlamConfig{}, run_inline);
    trial.Start(world_.map(), loop, /*scale_is_known=*/true, /*find_lens=*/false);
    return trial.Conclude(/*wait=*/true, world_.map());
  }

  // Distance between the newest keyframe's position and its true position, in the frame of the first keyframe.
  double NewestError_mu() {
    const int newest = static_cast<int>(world_.newest().id.value) - 1;
    const auto& first = world_.map().keyframes().begin()->second;
    const SE3<Camera, Camera> estimated = first.T_camera_world() * world_.newest().T_world_camera();
    const SE3<Camera, Camera> truth = LoopWorld::TruePose(0).Inverse() * LoopWorld::TruePose(newest);
    return (estimated.translation() - truth.translation()).norm();
  }

  LoopWorld world_{LoopWorld::kKeyframesPerRound + 4, {.rotation_deg = 0.03, .shift_mu = 0.001}};
  LoopMatch loop_;
};

TEST_F(LoopTrialTest, ATrueLoopRemovesTheDrift) {
  const double before_mu = NewestError_mu();
  ASSERT_GT(before_mu, 0.02);
  EXPECT_EQ(Try(loop_), LoopTrial::Verdict::kClosed);
  EXPECT_LT(NewestError_mu(), 0.5 * before_mu);
}

TEST_F(LoopTrialTest, RunsInTheBackground) { EXPECT_EQ(Try(loop_, /*run_inline=*/false), LoopTrial::Verdict::kClosed); }

TEST_F(LoopTrialTest, AWrongLoopLeavesTheMapAsItWas) {
  LoopMatch wrong = loop_;
  // Half a round off.
  wrong.S_old_newest = Sim3<Camera, Camera>(LoopWorld::TruePose(4).Inverse() * LoopWorld::TruePose(16));
  const SE3<World, Camera> before = world_.newest().T_world_camera();
  const size_t points = world_.map().points().size();
  EXPECT_EQ(Try(wrong), LoopTrial::Verdict::kRejected);
  EXPECT_EQ(world_.newest().T_world_camera().translation(), before.translation());
  EXPECT_EQ(world_.map().points().size(), points);
}

}  // namespace romap::slam::loop_trial_test
