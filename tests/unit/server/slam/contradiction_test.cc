// Given poses and depth images that contradict the images, from the tracker to the map.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "common/angles.h"
#include "tests/unit/server/slam/tracking_fixture.h"

namespace romap::slam::contradiction_test {

using ::testing::IsEmpty;

class ContradictionTest : public TrackingTest {
 protected:
  static constexpr int kFrames = 60;

  ContradictionTest() : TrackingTest(PoseUse::kGiven, 320, 240) {}

  // An arc that is seen with more rotation than that of the base class.
  std::shared_ptr<Frame> RenderGiven(int i) const {
    return world_.Render(static_cast<uint64_t>(i + 1), TexturedWorld::OrbitPose(3.0 * i));
  }

  void Process(std::shared_ptr<const Frame> frame) {
    image_ = tracker_->Track(std::move(frame));
    mapped_ = mapper_->Process(image_);
  }
  // Forty frames whose poses are in a turned world.
  void ProcessTurned(const Eigen::Quaterniond& R_given_world) {
    for (int i = 0; i < 40; ++i) {
      const auto frame = RenderGiven(i);
      LabelTile(*frame);
      const SE3<World, Camera>& pose = *frame->T_world_camera;
      frame->T_world_camera = SE3<World, Camera>(R_given_world * pose.rotation(), R_given_world * pose.translation());
      Process(frame);
    }
  }
};

TEST_F(ContradictionTest, SoundPosesAndDepthGiveNoDiagnostic) {
  for (int i = 0; i < kFrames; ++i) {
    const auto frame = RenderGiven(i);
    frame->depth_mu = world_.RenderDepth(*frame);
    Process(frame);
    ASSERT_EQ(mapped_.tracked.state, TrackingState::kTracking) << i;
    ASSERT_FALSE(mapped_.tracked.frame->depth_mu.empty()) << i;
  }
  EXPECT_THAT(mapper_->Diagnostics(), IsEmpty());
}

TEST_F(ContradictionTest, FramesOfAWrongConventionAreLostWithAReason) {
  int refused = 0;
  for (int i = 0; i < kFrames; ++i) {
    const auto frame = RenderGiven(i);
    const SE3<World, Camera>& pose = *frame->T_world_camera;
    frame->T_world_camera = SE3<World, Camera>(pose.rotation() * Eigen::Quaterniond(0, 1, 0, 0), pose.translation());
    Process(frame);
    if (mapped_.tracked.state != TrackingState::kLost) continue;
    ++refused;
    EXPECT_EQ(mapped_.tracked.reason, "the given pose contradicts the images");
    EXPECT_EQ(mapped_.tracked.contradicted_since_frame, 1u);
    EXPECT_FALSE(mapped_.view.has_value());
  }
  EXPECT_GE(refused, kFrames / 2);
  const std::vector<Diagnostic> diagnostics = mapper_->Diagnostics();
  ASSERT_EQ(diagnostics.size(), 1u);
  EXPECT_EQ(diagnostics[0].code, "poses_contradict_images");
  EXPECT_EQ(diagnostics[0].severity, Severity::kError);
  EXPECT_EQ(diagnostics[0].advice, "run with --pose-convention opengl");
}

TEST_F(ContradictionTest, DepthOfAnotherScaleIsNotUsed) {
  int frames_with_depth = 0;
  for (int i = 0; i < kFrames; ++i) {
    const auto frame = RenderGiven(i);
    frame->depth_mu = 0.2 * world_.RenderDepth(*frame);
    Process(frame);
    EXPECT_EQ(mapped_.tracked.state, TrackingState::kTracking);
    frames_with_depth += mapped_.tracked.frame->depth_mu.empty() ? 0 : 1;
  }
  EXPECT_LE(frames_with_depth, 15);
  EXPECT_TRUE(HasWarning("depth_contradicts_images"));
  // Points that such a depth made would be half a unit off and more.
  EXPECT_GT(map().points().size(), 300u);
  for (const auto& [id, track] : map().points()) {
    EXPECT_LT(TexturedWorld::DistanceToSurface_mu(track.point.position_world), 0.3);
  }
}

TEST_F(ContradictionTest, UpOfGivenPosesReachesAllResults) {
  const Eigen::Vector3d up_world(0, -3, 0);
  mapper_ = std::make_unique<SparseMapper>(SlamConfig{}, slot_.get(), SparseMapper::Background::kNothing,
                                           GivenUp{.direction_world = up_world});
  for (int i = 0; i < 10; ++i) {
    Process(RenderGiven(i));
    EXPECT_EQ(mapped_.tracked.up_world, -Eigen::Vector3d::UnitY()) << i;
    if (mapped_.view) {
      EXPECT_EQ(mapped_.view->up_world, -Eigen::Vector3d::UnitY()) << i;
    }
    if (mapped_.correction) {
      EXPECT_EQ(mapped_.correction->up_world, -Eigen::Vector3d::UnitY()) << i;
    }
  }
  EXPECT_EQ(mapper_->Finish().up_world, -Eigen::Vector3d::UnitY());
}

TEST_F(ContradictionTest, AnotherUpIsNamed) {
  const auto process = [&](double angle_rad) {
    slot_ = std::make_unique<LocalMapSlot>();
    tracker_ = std::make_unique<Tracker>(SlamConfig{}, PoseUse::kGiven, slot_.get());
    mapper_ = std::make_unique<SparseMapper>(SlamConfig{}, slot_.get(), SparseMapper::Background::kNothing);
    const Eigen::Quaterniond R_given_world(Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitX()));
    ProcessTurned(R_given_world);
    mapper_->Finish();
    return mapper_->Diagnostics();
  };
  EXPECT_THAT(process(0), IsEmpty());
  std::vector<Diagnostic> diagnostics = process(-0.5 * EIGEN_PI);
  ASSERT_EQ(diagnostics.size(), 1u);
  EXPECT_EQ(diagnostics[0].code, "up_contradicts_images");
  EXPECT_EQ(diagnostics[0].advice, "run with --up y");
  diagnostics = process(0.8 * EIGEN_PI);
  ASSERT_EQ(diagnostics.size(), 1u);
  EXPECT_EQ(diagnostics[0].advice, "run with --up auto");
}

TEST_F(ContradictionTest, UpOfGivenPosesIsEstimated) {
  mapper_ = std::make_unique<SparseMapper>(SlamConfig{}, slot_.get(), SparseMapper::Background::kNothing,
                                           GivenUp{.estimate = true});
  const Eigen::Quaterniond R_given_world(Eigen::AngleAxisd(-1.3, Eigen::Vector3d::UnitX()));
  ProcessTurned(R_given_world);
  const Eigen::Vector3d up_world = R_given_world * Eigen::Vector3d::UnitZ();
  EXPECT_LT(AngleBetween(mapper_->Finish().up_world, up_world), 0.03);
  EXPECT_THAT(mapper_->Diagnostics(), IsEmpty());
}

}  // namespace romap::slam::contradiction_test
