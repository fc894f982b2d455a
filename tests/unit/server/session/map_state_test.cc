#include "server/session/map_state.h"

#include <gtest/gtest.h>

#include <cmath>

namespace romap::session::map_state_test {

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

MeshPose PoseAt(double x) { return {{Eigen::Quaterniond::Identity(), Eigen::Vector3d(x, 0, 0)}, {}}; }

std::shared_ptr<Outbox> Subscribe(MapState& map) { return map.Subscribe(Outbox::Acks::kAll, 100); }

// Without the events of the current objects.
std::shared_ptr<Outbox> SubscribeToChanges(MapState& map) {
  auto outbox = Subscribe(map);
  while (outbox->Next(kNoWait)) {
  }
  return outbox;
}

TEST(MapStateTest, CuboidsAndMeshesShareOneRevisionCounter) {
  MapState map;
  const auto outbox = Subscribe(map);
  map.Apply(Update(1));
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox->Next(kNoWait)).revision, 1u);
  map.PublishMesh(MeshOf(1), PoseAt(0));
  EXPECT_EQ(std::get<MeshUpdate>(*outbox->Next(kNoWait)).revision, 2u);
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox->Next(kNoWait)).revision, 3u)
      << "the pose of the mesh is part of the object update";
  map.Apply(Update(1));
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox->Next(kNoWait)).revision, 4u);
  map.Apply(ObjectRemoved{ObjectId{1}, 0, "false landmark"});
  EXPECT_EQ(std::get<ObjectRemoved>(*outbox->Next(kNoWait)).revision, 5u);
}

TEST(MapStateTest, MeshOfARemovedObjectIsNotPublished) {
  MapState map;
  const auto outbox = Subscribe(map);
  map.Apply(Update(1));
  map.Apply(ObjectMerged{ObjectId{1}, ObjectId{2}, 0});
  map.PublishMesh(MeshOf(1), PoseAt(0));
  while (const auto event = outbox->Next(kNoWait)) EXPECT_FALSE(std::holds_alternative<MeshUpdate>(*event));
}

TEST(MapStateTest, RemovedObjectsStayRemoved) {
  MapState map;
  for (uint64_t id : {1, 2, 3}) map.Apply(Update(id));
  map.Apply(ObjectRemoved{ObjectId{1}, 0, "false landmark"});
  map.Apply(ObjectMerged{ObjectId{2}, ObjectId{3}, 0});
  const auto outbox = SubscribeToChanges(map);
  for (uint64_t id : {1, 2}) {
    map.Apply(Update(id));
    map.Apply(ObjectRemoved{ObjectId{id}, 0, "again"});
    map.Apply(ObjectMerged{ObjectId{id}, ObjectId{3}, 0});
  }
  EXPECT_EQ(outbox->Next(kNoWait), std::nullopt);
  EXPECT_EQ(map.Snapshot().objects.size(), 1u);
}

TEST(MapStateTest, MergeIncreasesTheRevisionOfTheRemainingObject) {
  MapState map;
  const auto outbox = Subscribe(map);
  for (uint64_t id : {1, 2}) {
    map.Apply(Update(id));
    EXPECT_TRUE(outbox->Next(kNoWait).has_value());
  }
  map.Apply(ObjectMerged{ObjectId{1}, ObjectId{2}, 0});
  EXPECT_EQ(std::get<ObjectMerged>(*outbox->Next(kNoWait)).revision, 2u);
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox->Next(kNoWait)).revision, 3u) << "for readers that do not get the merge";
  EXPECT_EQ(map.Snapshot().objects.at(0).object.revision, 3u);
}

TEST(MapStateTest, MergeIntoAnUnknownObjectIsARemoval) {
  MapState map;
  const auto outbox = Subscribe(map);
  map.Apply(Update(1));
  EXPECT_TRUE(outbox->Next(kNoWait).has_value());
  map.Apply(ObjectMerged{ObjectId{1}, ObjectId{2}, 0});
  const auto removed = std::get<ObjectRemoved>(*outbox->Next(kNoWait));
  EXPECT_EQ(removed.id, ObjectId{1});
  EXPECT_EQ(removed.revision, 2u);
}

TEST(MapStateTest, UpdatesContainThePoseOfTheMesh) {
  MapState map;
  map.Apply(Update(1));
  map.PublishMesh(MeshOf(1), PoseAt(5));
  map.Apply(Update(1));
  const auto outbox = Subscribe(map);
  const auto update = std::get<ObjectUpdate>(*outbox->Next(kNoWait));
  ASSERT_TRUE(update.T_world_mesh.has_value());
  EXPECT_EQ(update.T_world_mesh->translation().x(), 5);
}

Sim3<World, World> Correction(double scale, double yaw_rad, double x) {
  return {scale, Eigen::Quaterniond(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ())), Eigen::Vector3d(x, 0, 0)};
}

// World position of a vertex of the newest mesh.
Eigen::Vector3d VertexInWorld(const ObjectUpdate& object, const Eigen::Vector3d& vertex) {
  return *object.T_world_mesh * (object.mesh_scale * vertex);
}

TEST(MapStateTest, CorrectionMovesTheMeshWithoutSendingItAgain) {
  const Eigen::Vector3d vertex(0.1, -0.2, 0.3);
  MapState map;
  map.Apply(Update(1));
  map.PublishMesh(MeshOf(1), PoseAt(5));
  const auto outbox = SubscribeToChanges(map);
  const Eigen::Vector3d before = VertexInWorld(map.Snapshot().objects[0].object, vertex);
  const Sim3<World, World> first = Correction(1.3, 0.35, 2), second = Correction(0.9, -0.1, -1);
  for (const Sim3<World, World>& S : {first, second}) {
    map.MoveObject(ObjectId{1}, S);
    map.Apply(Update(1));
  }
  std::optional<ObjectUpdate> last;
  while (const auto event = outbox->Next(kNoWait)) {
    ASSERT_TRUE(std::holds_alternative<ObjectUpdate>(*event));
    last = std::get<ObjectUpdate>(*event);
  }
  ASSERT_TRUE(last.has_value());
  EXPECT_NEAR(last->mesh_scale, 1.3 * 0.9, 1e-12);
  EXPECT_TRUE(VertexInWorld(*last, vertex).isApprox(second * (first * before), 1e-12));
}

// The map is corrected while the mesh is made: the snapshot includes the first correction but not the second.
TEST(MapStateTest, MeshOfAnOlderSnapshotGetsTheMissingCorrections) {
  const Eigen::Vector3d vertex(0.1, -0.2, 0.3);
  const Sim3<World, World> first = Correction(1.3, 0.35, 2), second = Correction(0.9, -0.1, -1);
  MapState map;
  map.Apply(Update(1));
  map.MoveObject(ObjectId{1}, first);
  MeshPose pose = PoseAt(5);
  pose.S_new_first = first;
  map.MoveObject(ObjectId{1}, second);
  map.PublishMesh(MeshOf(1), pose);
  const ObjectUpdate late = map.Snapshot().objects[0].object;
  EXPECT_TRUE(VertexInWorld(late, vertex).isApprox(second * (pose.T_world_mesh * vertex), 1e-12));
  EXPECT_NEAR(late.mesh_scale, 0.9, 1e-12);

  // The next snapshot includes both corrections; its scale is 1.
  pose.S_new_first = second * first;
  map.PublishMesh(MeshOf(1), pose);
  const ObjectUpdate current = map.Snapshot().objects[0].object;
  EXPECT_TRUE(VertexInWorld(current, vertex).isApprox(pose.T_world_mesh * vertex, 1e-12));
  EXPECT_NEAR(current.mesh_scale, 1, 1e-12);
  map.MoveObject(ObjectId{99}, first);  // unknown object: ignored
}

SE3<World, Camera> CameraAt(double x, double yaw_rad = 0) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ())), Eigen::Vector3d(x, 0, 0)};
}

TEST(MapStateTest, FramesMoveWithTheirKeyframes) {
  MapState map;
  const SE3<Camera, Camera> T_reference_camera(Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY())),
                                               Eigen::Vector3d(0.5, 0, 0));
  FrameAck keyframe, follower, given;
  keyframe.frame_id = 1;
  keyframe.is_keyframe = true;
  keyframe.T_world_camera = CameraAt(10);
  follower.frame_id = 2;
  follower.T_world_camera = CameraAt(10) * T_reference_camera;
  given.frame_id = 3;
  given.T_world_camera = CameraAt(12);
  map.Acknowledge(keyframe, 10, KeyframeId{1});
  map.Acknowledge(follower, 20, KeyframeId{1}, T_reference_camera);
  map.Acknowledge(given, 30);
  EXPECT_TRUE(map.Snapshot().trajectory[1].T_world_camera->Matrix().isApprox(follower.T_world_camera->Matrix()));

  const Sim3<World, World> S = Correction(1.5, 0.2, 3);
  MapCorrection correction;
  correction.keyframes = {{KeyframeId{1}, S.Moved(CameraAt(10)), S}};
  map.Correct(correction);
  const std::vector<FrameAck> moved = map.Snapshot().trajectory;
  for (size_t i = 0; i < 2; ++i) {
    const SE3<World, Camera>& before = i == 0 ? *keyframe.T_world_camera : *follower.T_world_camera;
    EXPECT_TRUE(moved[i].T_world_camera->Matrix().isApprox(S.Moved(before).Matrix(), 1e-12)) << i;
  }
  EXPECT_EQ(moved[2].T_world_camera->translation(), given.T_world_camera->translation()) << "has no reference keyframe";

  // A frame that was tracked before the correction is acknowledged after it.
  follower.frame_id = 4;
  map.Acknowledge(follower, 40, KeyframeId{1}, T_reference_camera);
  EXPECT_TRUE(map.Snapshot().trajectory[3].T_world_camera->Matrix().isApprox(S.Moved(*follower.T_world_camera).Matrix(),
                                                                             1e-12));
}

TEST(MapStateTest, FramesTakeOverTheUncertaintyOfTheirKeyframes) {
  MapState map;
  FrameAck tracked, given;
  tracked.frame_id = 1;
  tracked.T_world_camera = CameraAt(10);
  tracked.uncertainty = PoseUncertainty{5, 0.5};
  given.frame_id = 2;
  given.T_world_camera = CameraAt(12);
  const PoseUncertainty relative{0.3, 0.03};
  map.Acknowledge(tracked, 10, KeyframeId{1}, {}, relative);
  map.Acknowledge(given, 20);
  EXPECT_EQ(map.Snapshot().trajectory[0].uncertainty, tracked.uncertainty) << "no correction came";

  // The map grows to twice its size around the keyframe.
  const Sim3<World, World> S = Correction(2, 0, 0);
  MapCorrection correction;
  correction.keyframes = {{KeyframeId{1}, S.Moved(CameraAt(10)), S}};
  correction.uncertainties = {{KeyframeId{1}, PoseUncertainty{0.8, 0.04}}};
  map.Correct(correction);
  const std::vector<FrameAck> corrected = map.Snapshot().trajectory;
  ASSERT_TRUE(corrected[0].uncertainty.has_value());
  // Half of the relative uncertainty is added again for the alignment.
  EXPECT_NEAR(corrected[0].uncertainty->position_sigma_mu, std::hypot(0.8, 2 * 0.3, 0.3), 1e-12) << "twice the size";
  EXPECT_NEAR(corrected[0].uncertainty->rotation_sigma_rad, std::hypot(0.04, 0.03, 0.015), 1e-12);
  EXPECT_FALSE(corrected[1].uncertainty.has_value());
}

TEST(MapStateTest, SubscriptionStartsWithTheCurrentObjects) {
  MapState map;
  map.Apply(Update(1));
  map.PublishMesh(MeshOf(1), PoseAt(0));
  map.Apply(Update(2));
  const auto outbox = Subscribe(map);
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox->Next(kNoWait)).id, ObjectId{1});
  EXPECT_EQ(std::get<MeshUpdate>(*outbox->Next(kNoWait)).id, ObjectId{1});
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox->Next(kNoWait)).id, ObjectId{2});
  EXPECT_EQ(outbox->Next(kNoWait), std::nullopt);
}

TEST(MapStateTest, SnapshotOmitsProvisionalObjectsAndRejectedFrames) {
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

TEST(MapStateTest, CloseEndsCurrentAndLaterSubscriptions) {
  MapState map;
  map.Apply(Update(1));
  const auto before = Subscribe(map);
  map.Close(absl::OkStatus());
  const auto after = Subscribe(map);
  for (const auto& outbox : {before, after}) {
    EXPECT_TRUE(outbox->Next(kNoWait).has_value());
    EXPECT_TRUE(outbox->Done());
  }
}

TEST(MapStateTest, FramesOfAMergedMapBelongToTheMapItWasMergedInto) {
  MapState map;
  for (uint64_t id = 1; id <= 3; ++id) {
    FrameAck ack;
    ack.frame_id = id;
    ack.T_world_camera.emplace();
    ack.map_id = SparseMapId{id};
    map.Acknowledge(ack, static_cast<int64_t>(id));
  }
  MapCorrection correction;
  correction.merged_maps = {{.from = SparseMapId{3}, .into = SparseMapId{2}}};
  map.Correct(correction);
  correction.merged_maps = {{.from = SparseMapId{2}, .into = SparseMapId{1}}};
  map.Correct(correction);
  for (const FrameAck& ack : map.Snapshot().trajectory) EXPECT_EQ(ack.map_id, SparseMapId{1}) << ack.frame_id;
}

}  // namespace romap::session::map_state_test
