// A camera that gets lost in new territory: Tracker and SparseMapper together, frame by frame, in a synthetic world.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/slam/sparse_mapper.h"
#include "server/slam/tracker.h"
#include "tests/support/sparse_mapper_inspector.h"
#include "tests/unit/server/slam/textured_world.h"
#include "tests/unit/server/slam/tracking_fixture.h"

namespace romap::slam::several_maps_test {

constexpr int kFramesPerSecond = 30;

class SeveralMapsTest : public TrackingTest {
 protected:
  SeveralMapsTest() : TrackingTest(PoseUse::kIgnore, 400, 300) {}

  void Restart(PoseUse pose_use, SparseMapper::Background background = SparseMapper::Background::kNothing) {
    TrackingTest::Restart(pose_use, background);
    next_frame_ = 1;
  }

  SparseMapperInspector Inspect() const { return SparseMapperInspector(*mapper_); }
  const MapAtlas& atlas() const { return Inspect().atlas(); }

  // The camera above the floor, looking at the point (x, y) of it while it circles around that.
  static SE3<World, Camera> Above(double x, double y, int i) {
    const double angle_rad = 0.5 + 0.03 * i;
    const Eigen::Vector3d target(x, y, 0);
    return TexturedWorld::LookAt(
        target + Eigen::Vector3d(0.5 * std::cos(angle_rad), 0.5 * std::sin(angle_rad), 1.0 + 0.1 * std::sin(0.1 * i)),
        target);
  }
  // Two places that have no part of the floor in common.
  static SE3<World, Camera> AtFirst(int i) { return Above(-1.3 + 0.012 * i, -1.2, i); }
  static SE3<World, Camera> AtSecond(int i) { return Above(1.3, 1.2 - 0.01 * i, 40 + i); }
  // From AtSecond(40) to AtFirst(20).
  static constexpr int kReturnFrames = 60;
  static SE3<World, Camera> OnReturn(int i) {
    const double share = static_cast<double>(i) / kReturnFrames;
    return Above(1.3 - share * 2.36, 0.8 - share * 2, 80 - static_cast<int>(60 * share));
  }

  static SE3<World, Camera> OnFastReturn(int i) { return OnReturn(2 * i); }

  std::shared_ptr<Frame> Render(const SE3<World, Camera>& pose) const {
    auto frame = world_.Render(next_frame_, pose);
    if (with_depth_) frame->depth_mu = world_.RenderDepth(*frame);
    return frame;
  }

  TrackingState Process(std::shared_ptr<const Frame> frame) {
    ++next_frame_;
    const TrackingState state = ProcessFrame(frame);
    if (mapped_.correction) {
      for (const MapMerge& merge : mapped_.correction->merged_maps) merges_.push_back(merge);
    }
    return state;
  }

  int ProcessFrames(SE3<World, Camera> (*pose)(int), int count) {
    int tracked = 0;
    for (int i = 0; i < count; ++i) tracked += Process(Render(pose(i))) == TrackingState::kTracking ? 1 : 0;
    return tracked;
  }

  // Largest distance of a tracked camera of the current map from the truth after alignment by the best similarity, in
  // the truth's units; and the scale of that similarity.
  std::pair<double, double> Error() const {
    std::vector<Eigen::Vector3d> estimated, truth;
    for (const auto& frame : frames_) {
      const auto reference = Inspect().map().KeyframePose(frame.tracked.reference);
      if (!reference) continue;
      estimated.push_back(reference->Compose(frame.tracked.T_reference_camera).translation());
      truth.push_back(frame.truth.translation());
    }
    return WorstDistance(estimated, truth);
  }

  size_t FramesInCurrentMap() const {
    return static_cast<size_t>(std::count_if(frames_.begin(), frames_.end(), [&](const auto& frame) {
      return Inspect().map().KeyframePose(frame.tracked.reference).has_value();
    }));
  }

  bool WarnsOfSeveralMaps() const { return HasWarning("maps_unconnected"); }

  bool with_depth_ = false;
  std::vector<MapMerge> merges_;
  uint64_t next_frame_ = 1;
};

TEST_F(SeveralMapsTest, ACameraInNewTerritoryBeginsASecondMapAndKeepsTheFirst) {
  ASSERT_GT(ProcessFrames(AtFirst, 40), 20) << reason();
  const size_t keyframes = Inspect().map().keyframes().size();
  const SE3<World, Camera> last = frames_.back().tracked.T_world_camera;
  EXPECT_FALSE(WarnsOfSeveralMaps());
  int lost = 0;
  while (lost < 60 && Process(Render(AtSecond(lost))) == TrackingState::kLost) ++lost;
  EXPECT_GT(lost, 0.7 * kFramesPerSecond);
  EXPECT_LE(lost, 1.2 * kFramesPerSecond) << reason();
  EXPECT_EQ(image_.tracked.map, SparseMapId{2});
  EXPECT_TRUE(WarnsOfSeveralMaps());
  ASSERT_NE(atlas().Find(SparseMapId{1}), nullptr);
  EXPECT_EQ(atlas().Find(SparseMapId{1})->map.keyframes().size(), keyframes);
  // The new world begins where the old one ended. The camera has moved a few frames since.
  EXPECT_LT(frames_.back().tracked.T_world_camera.rotation().angularDistance(last.rotation()), 0.6);
  EXPECT_LT((frames_.back().tracked.T_world_camera.translation() - last.translation()).norm(), 0.6);

  EXPECT_GT(ProcessFrames(AtSecond, 40), 30) << reason();
  EXPECT_LT(Error().first, 0.03);
}

TEST_F(SeveralMapsTest, TheReturnMergesBothMapsIntoOneWorld) {
  ProcessFrames(AtFirst, 40);
  ProcessFrames(AtSecond, 41);
  ASSERT_EQ(atlas().maps(), 2U) << reason();
  ProcessFrames(OnReturn, kReturnFrames);
  ProcessFrames([](int i) { return AtFirst(20 + i); }, 20);
  EXPECT_EQ(atlas().maps(), 1U) << reason();
  EXPECT_EQ(Inspect().maps_merged(), 1);
  EXPECT_EQ(merges_.size(), 1U);
  EXPECT_FALSE(WarnsOfSeveralMaps());
  EXPECT_EQ(FramesInCurrentMap(), frames_.size());
  mapper_->Finish();
  // The path is six units long. In two worlds, the frames of one map would be far from the truth.
  EXPECT_LT(Error().first, 0.05);
}

TEST_F(SeveralMapsTest, ACameraThatIsBackAtAKeptMapContinuesThere) {
  ProcessFrames(AtFirst, 40);
  ProcessFrames(AtSecond, 50);
  ASSERT_EQ(atlas().current().id, SparseMapId{2});
  int lost = 0;
  while (lost < 20 && Process(Render(AtFirst(lost))) == TrackingState::kLost) ++lost;
  EXPECT_LE(lost, 5) << reason();
  EXPECT_EQ(image_.tracked.map, SparseMapId{1});
  EXPECT_EQ(atlas().current().id, SparseMapId{1});
  EXPECT_EQ(atlas().maps(), 2U) << "this does not connect the two maps";
  EXPECT_TRUE(merges_.empty());
  EXPECT_GT(ProcessFrames([](int i) { return AtFirst(6 + i); }, 50), 45) << reason();
  EXPECT_LT(Error().first, 0.03);
}

TEST_F(SeveralMapsTest, AShortLossBeginsNoMap) {
  ProcessFrames(AtFirst, 40);
  ProcessFrames(AtSecond, 18);
  int lost = 0;
  while (lost < 20 && Process(Render(AtFirst(40 + lost))) == TrackingState::kLost) ++lost;
  EXPECT_LE(lost, 3);
  EXPECT_EQ(Inspect().maps_begun(), 1);
}

TEST_F(SeveralMapsTest, WithDepthTheSecondMapBeginsAtOnceAndTheScaleIsKept) {
  with_depth_ = true;
  ASSERT_EQ(ProcessFrames(AtFirst, 30), 29);
  int lost = 0;
  while (lost < 60 && Process(Render(AtSecond(lost))) == TrackingState::kLost) ++lost;
  EXPECT_LE(lost, 0.9 * kFramesPerSecond) << reason();
  EXPECT_EQ(image_.tracked.map, SparseMapId{2});
  ProcessFrames([](int i) { return AtSecond(30 + i); }, 11);
  ProcessFrames(OnFastReturn, kReturnFrames / 2);
  EXPECT_EQ(atlas().maps(), 1U) << reason();
  const auto [worst, scale] = Error();
  EXPECT_LT(worst, 0.05);
  EXPECT_NEAR(scale, 1, 0.01);
}

TEST_F(SeveralMapsTest, NoSecondMapWhereThePosesOfTheClientDefineTheWorld) {
  Restart(PoseUse::kGiven);
  ProcessFrames(AtFirst, 40);
  for (int i = 0; i < 50; ++i) {
    auto frame = Render(AtSecond(i));
    frame->T_world_camera.reset();
    const TrackedImage image = tracker_->Track(frame);
    mapper_->Process(image);
    ++next_frame_;
    EXPECT_EQ(image.tracked.state, TrackingState::kLost);
  }
  EXPECT_EQ(atlas().maps(), 1U);
  EXPECT_EQ(Process(Render(AtSecond(50))), TrackingState::kTracking);
  EXPECT_EQ(image_.tracked.map, SparseMapId{1});
}

TEST_F(SeveralMapsTest, SameFramesGiveTheSameMaps) {
  with_depth_ = true;
  std::vector<Eigen::Matrix4d> first;
  for (int round = 0; round < 2; ++round) {
    Restart(PoseUse::kIgnore);
    ProcessFrames(AtFirst, 20);
    ProcessFrames(AtSecond, 30);
    for (int i = 0; i < kReturnFrames / 2 && Inspect().maps_merged() == 0; ++i) Process(Render(OnFastReturn(i)));
    ASSERT_EQ(Inspect().maps_merged(), 1);
    std::vector<Eigen::Matrix4d> poses;
    for (const auto& [id, keyframe] : Inspect().map().keyframes()) poses.push_back(keyframe.T_world_camera().Matrix());
    if (round == 0) first = poses;
    EXPECT_EQ(first, poses);
  }
}

TEST_F(SeveralMapsTest, MergesInTheBackground) {
  Restart(PoseUse::kIgnore, SparseMapper::Background::kAllAdjustment);
  ProcessFrames(AtFirst, 40);
  ProcessFrames(AtSecond, 41);
  ASSERT_EQ(atlas().maps(), 2U) << reason();
  ProcessFrames(OnReturn, kReturnFrames);
  mapper_->Finish();
  EXPECT_EQ(atlas().maps(), 1U);
  EXPECT_LT(Error().first, 0.05);
}

}  // namespace romap::slam::several_maps_test
