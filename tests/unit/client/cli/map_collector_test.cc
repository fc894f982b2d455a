#include "client/cli/map_collector.h"

#include <gtest/gtest.h>

namespace romap::cli::map_collector_test {

ObjectUpdate Update(uint64_t id, uint64_t revision, ObjectState state = ObjectState::kConfirmed) {
  ObjectUpdate update;
  update.id = ObjectId{id};
  update.revision = revision;
  update.state = state;
  update.observations = revision;
  return update;
}

MeshUpdate MeshOf(uint64_t id, uint64_t revision) {
  MeshUpdate mesh;
  mesh.id = ObjectId{id};
  mesh.revision = revision;
  return mesh;
}

TEST(MapCollectorTest, KeepsTheNewestRevisionOnly) {
  MapCollector collector;
  collector.Apply(Update(1, 3));
  collector.Apply(Update(1, 2));
  EXPECT_EQ(collector.objects().at(ObjectId{1}).object.observations, 3u);
  collector.Apply(MeshOf(1, 5));
  collector.Apply(MeshOf(1, 4));
  EXPECT_EQ(collector.objects().at(ObjectId{1}).mesh->revision, 5u);
}

TEST(MapCollectorTest, DropsRemovedAndMergedObjects) {
  MapCollector collector;
  for (uint64_t id : {1, 2, 3}) collector.Apply(Update(id, 1));
  collector.Apply(ObjectRemoved{ObjectId{1}, 2, "false detection"});
  collector.Apply(ObjectMerged{ObjectId{2}, ObjectId{3}, 2});
  ASSERT_EQ(collector.objects().size(), 1u);
  EXPECT_TRUE(collector.objects().contains(ObjectId{3}));
}

TEST(MapCollectorTest, IgnoresAMeshOfAnUnknownObject) {
  MapCollector collector;
  collector.Apply(MeshOf(7, 1));
  EXPECT_TRUE(collector.objects().empty());
}

TEST(MapCollectorTest, DoesNotCountProvisionalObjects) {
  MapCollector collector;
  collector.Apply(Update(1, 1, ObjectState::kProvisional));
  EXPECT_EQ(collector.ConfirmedObjects(), 0u);
  EXPECT_LT(collector.ArrivalOf(ObjectId{1}).first_cuboid_s, 0);
  collector.Apply(Update(1, 2));
  EXPECT_EQ(collector.ConfirmedObjects(), 1u);
  EXPECT_GE(collector.ArrivalOf(ObjectId{1}).first_cuboid_s, 0);
}

TEST(MapCollectorTest, CountsTrackingStates) {
  MapCollector collector;
  const auto apply = [&](TrackingState state, bool has_pose, const std::string& reason) {
    FrameAck ack;
    ack.state = state;
    ack.state_reason = reason;
    if (has_pose) ack.T_world_camera.emplace();
    collector.Apply(ack);
  };
  apply(TrackingState::kInitializing, false, "too little parallax");
  apply(TrackingState::kTracking, true, "");
  apply(TrackingState::kLost, false, "dark");
  apply(TrackingState::kRelocalized, true, "");
  EXPECT_EQ(collector.tracking().initializing, 1U);
  EXPECT_EQ(collector.tracking().tracked, 2U);
  EXPECT_EQ(collector.tracking().lost, 1U);
  EXPECT_EQ(collector.tracking().relocalized, 1U);
  EXPECT_EQ(collector.tracking().last_reason, "dark");
}

TEST(MapCollectorTest, BuildsTheTrajectoryFromAcknowledgements) {
  MapCollector collector;
  collector.NoteSent(1, 1000, true);
  collector.NoteSent(2, 2000, false);
  FrameAck good;
  good.frame_id = 1;
  good.T_world_camera = SE3<World, Camera>();
  good.is_keyframe = true;
  collector.Apply(good);
  FrameAck bad;
  bad.frame_id = 2;
  bad.accepted = false;
  bad.error = "image is truncated";
  collector.Apply(bad);
  EXPECT_EQ(collector.sent(), 2u);
  EXPECT_EQ(collector.acknowledged(), 2u);
  EXPECT_EQ(collector.rejected(), 1u);
  EXPECT_EQ(collector.keyframes(), 1u);
  ASSERT_EQ(collector.Trajectory().size(), 1u);
  EXPECT_EQ(collector.Trajectory()[0].timestamp_ns, 1000);
  ASSERT_EQ(collector.faults().size(), 1u);
  EXPECT_EQ(collector.faults()[0], "frame 2: image is truncated");
}

TEST(MapCollectorTest, NamesTheFileOfARejectedFrame) {
  MapCollector collector;
  const files::FramePaths paths{.image = "rgb/1.png", .mask = "mask/1.png", .depth = "depth/1.png"};
  collector.NoteSent(1, 1000, /*has_masks=*/true, /*has_pose=*/true, paths);
  collector.NoteSent(2, 2000, /*has_masks=*/false);
  EXPECT_EQ(collector.sent_with_pose(), 1u);
  for (const char* error : {"masks: PNG has 3 channels", "depth: too small", "image: too small"}) {
    FrameAck ack;
    ack.frame_id = 1;
    ack.accepted = false;
    ack.error = error;
    collector.Apply(ack);
  }
  collector.Apply(MasksAck{.frame_id = 1, .accepted = false, .error = "masks: too late"});
  ASSERT_EQ(collector.faults().size(), 4u);
  EXPECT_EQ(collector.faults()[0], "frame 1 (mask/1.png): masks: PNG has 3 channels");
  EXPECT_EQ(collector.faults()[1], "frame 1 (depth/1.png): depth: too small");
  EXPECT_EQ(collector.faults()[2], "frame 1 (rgb/1.png): image: too small");
  EXPECT_EQ(collector.faults()[3], "late masks of frame 1 (mask/1.png): masks: too late");
}

}  // namespace romap::cli::map_collector_test
