#include "server/session/map_state.h"

#include <gtest/gtest.h>

namespace romap {
namespace {

constexpr std::chrono::milliseconds kNoWait{0};

ObjectUpdate Update(uint64_t id, ObjectState state = ObjectState::kConfirmed) {
  ObjectUpdate update;
  update.id = ObjectId{id};
  update.state = state;
  return update;
}

MeshUpdate MeshOf(uint64_t id) {
  MeshUpdate mesh;
  mesh.id = ObjectId{id};
  return mesh;
}

MeshPlace PlaceAt(double x) { return {{Eigen::Quaterniond::Identity(), Eigen::Vector3d(x, 0, 0)}, {}}; }

std::shared_ptr<Outbox> Listen(MapState& map) { return map.Subscribe(Outbox::Acks::kAll, 100, true); }

TEST(MapStateTest, RevisionsGrowOverCuboidsAndMeshes) {
  MapState map;
  const auto outbox = Listen(map);
  map.Apply(Update(1));
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox->Next(kNoWait)).revision, 1u);
  map.PublishMesh(MeshOf(1), PlaceAt(0));
  EXPECT_EQ(std::get<MeshUpdate>(*outbox->Next(kNoWait)).revision, 2u);
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox->Next(kNoWait)).revision, 3u) << "the mesh's pose travels with the object";
  map.Apply(Update(1));
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox->Next(kNoWait)).revision, 4u);
  map.Apply(ObjectRemoved{ObjectId{1}, 0, "ghost"});
  EXPECT_EQ(std::get<ObjectRemoved>(*outbox->Next(kNoWait)).revision, 5u);
}

TEST(MapStateTest, AMeshWhoseObjectIsGoneIsNotPublished) {
  MapState map;
  const auto outbox = Listen(map);
  map.Apply(Update(1));
  map.Apply(ObjectMerged{ObjectId{1}, ObjectId{2}, 0});
  map.PublishMesh(MeshOf(1), PlaceAt(0));
  while (const auto event = outbox->Next(kNoWait)) EXPECT_FALSE(std::holds_alternative<MeshUpdate>(*event));
}

TEST(MapStateTest, UpdatesSayWhereTheMeshStands) {
  MapState map;
  map.Apply(Update(1));
  map.PublishMesh(MeshOf(1), PlaceAt(5));
  map.Apply(Update(1));
  const auto outbox = Listen(map);
  const auto update = std::get<ObjectUpdate>(*outbox->Next(kNoWait));
  ASSERT_TRUE(update.T_world_mesh.has_value());
  EXPECT_EQ(update.T_world_mesh->translation().x(), 5);
}

TEST(MapStateTest, ANewcomerGetsTheMapFirst) {
  MapState map;
  map.Apply(Update(1));
  map.PublishMesh(MeshOf(1), PlaceAt(0));
  map.Apply(Update(2));
  const auto outbox = Listen(map);
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox->Next(kNoWait)).id, ObjectId{1});
  EXPECT_EQ(std::get<MeshUpdate>(*outbox->Next(kNoWait)).id, ObjectId{1});
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox->Next(kNoWait)).id, ObjectId{2});
  EXPECT_EQ(outbox->Next(kNoWait), std::nullopt);
}

TEST(MapStateTest, SnapshotLeavesOutProvisionalObjectsAndRejectedFrames) {
  MapState map;
  map.Apply(Update(1, ObjectState::kProvisional));
  map.Apply(Update(2, ObjectState::kConfirmed));
  map.Apply(Update(3, ObjectState::kLost));
  FrameAck good;
  good.frame_id = 1;
  good.T_world_camera = SE3<World, Camera>();
  map.Acknowledge(good, 40);
  FrameAck bad;
  bad.frame_id = 2;
  bad.accepted = false;
  map.Acknowledge(bad, 80);
  const MapSnapshot snapshot = map.Snapshot();
  ASSERT_EQ(snapshot.objects.size(), 2u);
  EXPECT_EQ(snapshot.objects[0].object.id, ObjectId{2});
  EXPECT_EQ(map.ConfirmedObjects(), 2u);
  ASSERT_EQ(snapshot.trajectory.size(), 1u);
  EXPECT_EQ(snapshot.timestamps_ns[0], 40);
}

TEST(MapStateTest, CloseEndsPresentAndLaterSubscriptions) {
  MapState map;
  map.Apply(Update(1));
  const auto before = Listen(map);
  map.Close(absl::OkStatus());
  const auto after = Listen(map);
  for (const auto& outbox : {before, after}) {
    EXPECT_TRUE(outbox->Next(kNoWait).has_value());
    EXPECT_TRUE(outbox->Done());
  }
}

}  // namespace
}  // namespace romap
