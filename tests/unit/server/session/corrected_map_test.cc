// Corrections of the map, e.g. by a loop closure, passing through objects, fields, meshes and clients.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <map>

#include "common/mesh_codec.h"
#include "server/nerf/training_pool.h"
#include "server/objects/object_mapper.h"
#include "server/session/map_state.h"
#include "server/session/mesher.h"
#include "tests/support/sanitizer.h"
#include "tests/support/streams.h"
#include "tests/support/synthetic_world.h"

namespace romap::session::corrected_map_test {

using ::testing::SizeIs;

constexpr std::chrono::milliseconds kNoWait{0};

SyntheticWorldOptions SmallWorld() {
  SyntheticWorldOptions options;
  options.objects = {DefaultSyntheticObjects()[1], DefaultSyntheticObjects()[3]};
  options.width_px = 160;
  options.height_px = 120;
  options.focal_px = 150;
  options.frames = 36;
  options.keyframe_every = 2;
  return options;
}

nerf::NerfConfig FastNerf() {
  nerf::NerfConfig config;
  config.levels = 5;
  config.log2_table_entries = 12;
  config.finest_resolution = 128;
  config.rays_per_step = testing_support::kUnderSanitizer ? 256 : 512;
  config.full_budget_steps = 120;
  config.first_budget_steps = 60;
  return config;
}

// The stages after tracking, connected as in Pipeline.
class Stages {
 public:
  Stages() {
    mesher_session_ =
        mesher_.AddSession([this](MeshUpdate mesh, const MeshPose& pose) { map.PublishMesh(std::move(mesh), pose); });
    pool_session_ =
        pool_.AddSession([this](FieldSnapshot snapshot) { mesher_.Offer(mesher_session_, std::move(snapshot)); });
    outbox = map.Subscribe(Outbox::Acks::kAll, 100);
  }
  ~Stages() {
    pool_.RemoveSession(pool_session_);
    mesher_.RemoveSession(mesher_session_);
  }

  void Publish(objects::ObjectOutput output) {
    for (const ObjectViews& views : output.views) {
      if (views.S_new_old) map.MoveObject(views.object, *views.S_new_old);
    }
    for (MapEvent& event : output.events) map.Apply(std::move(event));
    for (ObjectViews& views : output.views) pool_.Offer(pool_session_, std::move(views));
  }

  void MapFrames(const SyntheticWorld& world) {
    for (int i = 0; i < world.frame_count(); ++i) {
      const TrackedFrame frame = world.MakeFrame(i);
      Publish(mapper.ObserveFrame(frame));
      if (!world.IsKeyframe(i)) continue;
      const KeyframeView keyframe = world.MakeKeyframe(i, frame);
      keyframes[keyframe.id] = keyframe.T_world_camera;
      Publish(mapper.ObserveKeyframe(keyframe));
    }
  }

  MapCorrection CorrectionOfAll(const Sim3<World, World>& S) const {
    MapCorrection correction;
    for (const auto& [id, T_world_camera] : keyframes) correction.keyframes.push_back({id, S.Moved(T_world_camera), S});
    return correction;
  }

  void TrainToCompletion() {
    pool_.Finish(pool_session_);
    WaitUntilIdle();
  }
  void WaitUntilIdle() const {
    ASSERT_TRUE(
        testing_support::Eventually([&] { return pool_.IsIdle(pool_session_) && mesher_.IsIdle(mesher_session_); }));
  }
  // Waits until at least one more training step was done, or nothing is left to train.
  void WaitForTraining() const {
    const uint64_t steps = pool_.GetProgress(pool_session_).steps;
    ASSERT_TRUE(testing_support::Eventually(
        [&] { return pool_.GetProgress(pool_session_).steps > steps || pool_.IsIdle(pool_session_); }));
  }

  objects::ObjectMapper mapper{objects::ObjectsConfig{}};
  MapState map;
  std::shared_ptr<Outbox> outbox;
  std::map<KeyframeId, SE3<World, Camera>> keyframes;

 private:
  Mesher mesher_{mesh::MeshConfig{}};
  nerf::TrainingPool pool_{FastNerf(), 1};
  uint64_t mesher_session_ = 0, pool_session_ = 0;
};

// The map of a client that applies all events.
struct Client {
  std::map<ObjectId, ObjectUpdate> objects;
  std::map<ObjectId, MeshUpdate> meshes;
  int mesh_updates = 0, object_updates = 0;

  void Read(Outbox& outbox) {
    mesh_updates = object_updates = 0;
    while (const auto event = outbox.Next(kNoWait)) {
      if (const auto* object = std::get_if<ObjectUpdate>(&*event)) {
        objects[object->id] = *object;
        ++object_updates;
      } else if (const auto* mesh = std::get_if<MeshUpdate>(&*event)) {
        meshes[mesh->id] = *mesh;
        ++mesh_updates;
      }
    }
  }
  // The vertices of an object's mesh as the client displays them.
  std::vector<Eigen::Vector3d> VerticesInWorld(ObjectId id) const {
    std::vector<Eigen::Vector3d> vertices;
    const auto mesh = DecodeDraco(meshes.at(id).draco);
    EXPECT_TRUE(mesh.ok());
    const ObjectUpdate& object = objects.at(id);
    for (const Eigen::Vector3f& vertex : mesh->vertices) {
      vertices.push_back(*object.T_world_mesh * (object.mesh_scale * vertex.cast<double>()));
    }
    return vertices;
  }
};

Sim3<World, World> LoopClosure() {
  return {1.3, Eigen::Quaterniond(Eigen::AngleAxisd(0.35, Eigen::Vector3d::UnitZ())), {2, -1, 0.5}};
}

TEST(CorrectedMapTest, LoopClosureMovesMeshesWithoutSendingThemAgain) {
  const SyntheticWorld world(SmallWorld());
  Stages stages;
  stages.MapFrames(world);
  stages.Publish(stages.mapper.Finish());
  stages.TrainToCompletion();
  Client client;
  client.Read(*stages.outbox);
  ASSERT_THAT(client.objects, SizeIs(2));
  ASSERT_THAT(client.meshes, SizeIs(2));
  const Client before = client;

  stages.Publish(stages.mapper.Correct(stages.CorrectionOfAll(LoopClosure())));
  stages.WaitUntilIdle();
  client.Read(*stages.outbox);
  EXPECT_EQ(client.mesh_updates, 0);
  EXPECT_EQ(client.object_updates, 2);
  for (const auto& [id, object] : client.objects) {
    EXPECT_NEAR(object.mesh_scale, 1.3, 1e-9);
    const std::vector<Eigen::Vector3d> old_vertices = before.VerticesInWorld(id);
    const std::vector<Eigen::Vector3d> vertices = client.VerticesInWorld(id);
    ASSERT_EQ(vertices.size(), old_vertices.size());
    for (size_t i = 0; i < vertices.size(); ++i) {
      ASSERT_TRUE(vertices[i].isApprox(LoopClosure() * old_vertices[i], 1e-9));
    }
    // The cuboid moved like its mesh.
    EXPECT_GT(ContainedShare(object.cuboid, vertices, 1.15), 0.95);
  }
}

TEST(CorrectedMapTest, MeshesMadeDuringCorrectionsAreInsideTheirCuboids) {
  const SyntheticWorld world(SmallWorld());
  Stages stages;
  stages.MapFrames(world);
  // Corrections alternate with training slices, snapshots and meshes.
  const Sim3<World, World> step(1.06, Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitZ())),
                                {0.3, 0, 0});
  for (int i = 0; i < 8; ++i) {
    stages.Publish(stages.mapper.Correct(stages.CorrectionOfAll(step)));
    for (auto& [id, T_world_camera] : stages.keyframes) T_world_camera = step.Moved(T_world_camera);
    stages.WaitForTraining();
  }
  stages.Publish(stages.mapper.Finish());
  stages.TrainToCompletion();
  Client client;
  client.Read(*stages.outbox);
  ASSERT_THAT(client.meshes, SizeIs(2));
  // The published cuboid is tight. The field is trained in a larger box, so its mesh may extend beyond the cuboid.
  for (const auto& [id, object] : client.objects) {
    EXPECT_GT(ContainedShare(object.cuboid, client.VerticesInWorld(id), 1.35), 0.95) << id;
  }
}

}  // namespace romap::session::corrected_map_test
