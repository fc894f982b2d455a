#include "server/objects/frame_history.h"

#include <gtest/gtest.h>

namespace romap::objects::frame_history_test {

constexpr int64_t kFramePeriod_ns = 40'000'000;

// Frame `id` of a camera that moves along x and looks along z.
TrackedFrame MakeTracked(uint64_t id, bool has_masks, KeyframeId reference) {
  auto frame = std::make_shared<Frame>();
  frame->frame_id = id;
  frame->timestamp_ns = static_cast<int64_t>(id) * kFramePeriod_ns;
  frame->camera = {.width_px = 64, .height_px = 48, .fx_px = 50, .fy_px = 50, .cx_px = 32, .cy_px = 24};
  frame->has_masks = has_masks;
  if (has_masks) frame->labels = cv::Mat(48, 64, CV_16UC1, cv::Scalar(9));
  TrackedFrame tracked;
  tracked.frame = frame;
  tracked.T_world_camera = {Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.01 * static_cast<double>(id), 0, 0)};
  tracked.reference = reference;
  return tracked;
}

KeyframeView MakeView(const TrackedFrame& tracked, uint64_t keyframe) {
  KeyframeView view;
  view.id = KeyframeId{keyframe};
  view.frame = tracked.frame;
  view.T_world_camera = tracked.T_world_camera;
  view.observations = {{.point = MapPointId{1}, .pixel_px = {32, 24}, .label = 0}};
  view.points = {{.id = MapPointId{1}, .position_world = {0.1, 0, 2}}};
  return view;
}

FrameMasks MakeMasks(uint64_t id) {
  return {.frame_id = id,
          .labels = cv::Mat(48, 64, CV_16UC1, cv::Scalar(5)),
          .instances = {{.label = 5, .class_name = "mug", .track_id = {}}}};
}

TEST(FrameHistory, LateMasksAreAcceptedOnceAndWithinTheMaximumDelay) {
  FrameHistory history(0.5);
  for (uint64_t id = 1; id <= 20; ++id) history.Add(MakeTracked(id, id == 19, {}));
  EXPECT_FALSE(history.AddLateMasks(MakeMasks(3))) << "640 ms old";
  EXPECT_FALSE(history.AddLateMasks(MakeMasks(19))) << "has masks";
  EXPECT_FALSE(history.AddLateMasks(MakeMasks(21))) << "unknown frame";
  const auto masked = history.AddLateMasks(MakeMasks(12));
  ASSERT_TRUE(masked);
  EXPECT_EQ(masked->tracked.frame->frame_id, 12u);
  EXPECT_TRUE(masked->tracked.frame->has_masks);
  EXPECT_EQ(masked->tracked.frame->labels.at<uint16_t>(3, 3), 5);
  ASSERT_EQ(masked->tracked.frame->instances.size(), 1u);
  EXPECT_FALSE(masked->view) << "not a keyframe";
  EXPECT_FALSE(history.AddLateMasks(MakeMasks(12))) << "twice";
}

TEST(FrameHistory, LateMasksLabelTheObservationsOfTheirKeyframe) {
  FrameHistory history(1);
  const TrackedFrame tracked = MakeTracked(1, false, {});
  history.Add(tracked);
  history.AddKeyframe(MakeView(tracked, 7));
  history.Add(MakeTracked(2, false, KeyframeId{7}));
  const auto masked = history.AddLateMasks(MakeMasks(1));
  ASSERT_TRUE(masked && masked->view);
  EXPECT_EQ(masked->view->id, KeyframeId{7});
  ASSERT_EQ(masked->view->observations.size(), 1u);
  EXPECT_EQ(masked->view->observations[0].label, 5);
}

TEST(FrameHistory, AMaskedFrameReplacesAKeyframeWithoutMasks) {
  FrameHistory history(1);
  PointRegistry points;
  const TrackedFrame first = MakeTracked(1, false, {});
  const KeyframeView view = MakeView(first, 7);
  points.UpdatePositions(view);
  history.Add(first);
  history.AddKeyframe(view);
  const TrackedFrame masked = MakeTracked(4, true, KeyframeId{7});
  history.Add(masked);
  const auto stand_in = history.MakeStandIn(masked, points);
  ASSERT_TRUE(stand_in);
  EXPECT_NE(stand_in->id, KeyframeId{7});
  ASSERT_EQ(stand_in->observations.size(), 1u);
  EXPECT_EQ(stand_in->observations[0].label, 9);
  EXPECT_NEAR(stand_in->observations[0].pixel_px.x(), 32 + 50 * (0.1 - 0.04) / 2, 1e-4);
  EXPECT_FALSE(history.MakeStandIn(masked, points)) << "one stand-in per keyframe";

  // It moves with its keyframe.
  const Sim3<World, World> S(2, Eigen::Quaterniond::Identity(), {0, 1, 0});
  KeyframeCorrections corrections;
  corrections[KeyframeId{7}] = {.id = KeyframeId{7}, .T_world_camera = S.Moved(view.T_world_camera), .S_new_old = S};
  history.Correct(&corrections);
  ASSERT_TRUE(corrections.contains(stand_in->id));
  const Eigen::Vector3d center = corrections.at(stand_in->id).T_world_camera.translation();
  EXPECT_NEAR((center - Eigen::Vector3d(0.08, 1, 0)).norm(), 0, 1e-12);
}

TEST(FrameHistory, AKeyframeWithMasksNeedsNoStandIn) {
  FrameHistory history(1);
  const TrackedFrame first = MakeTracked(1, true, {});
  history.Add(first);
  history.AddKeyframe(MakeView(first, 7));
  const TrackedFrame masked = MakeTracked(4, true, KeyframeId{7});
  history.Add(masked);
  EXPECT_FALSE(history.MakeStandIn(masked, {}));
}

TEST(FrameHistory, FramesWithoutMasksFollowCorrections) {
  FrameHistory history(1);
  const TrackedFrame first = MakeTracked(1, false, {});
  history.Add(first);
  history.AddKeyframe(MakeView(first, 7));
  history.Add(MakeTracked(3, false, KeyframeId{7}));
  const Sim3<World, World> S(1, Eigen::Quaterniond::Identity(), {0, 0, 0.5});
  KeyframeCorrections corrections;
  corrections[KeyframeId{7}] = {.id = KeyframeId{7}, .T_world_camera = S.Moved(first.T_world_camera), .S_new_old = S};
  history.Correct(&corrections);
  const auto keyframe = history.AddLateMasks(MakeMasks(1));
  const auto other = history.AddLateMasks(MakeMasks(3));
  ASSERT_TRUE(keyframe && keyframe->view && other);
  EXPECT_NEAR(keyframe->view->T_world_camera.translation().z(), 0.5, 1e-12);
  EXPECT_NEAR(other->tracked.T_world_camera.translation().z(), 0.5, 1e-12);
  EXPECT_NEAR(other->tracked.T_world_camera.translation().x(), 0.03, 1e-12);
}

}  // namespace romap::objects::frame_history_test
