#include "server/session/mesher.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <future>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "common/mesh_codec.h"
#include "tests/support/streams.h"
#include "tests/unit/server/mesh/field_fakes.h"

namespace romap::session::mesher_test {

FieldSnapshot BallSnapshot(uint64_t object, uint64_t steps) {
  FieldSnapshot snapshot = mesh::SnapshotOf(mesh::Sphere(0.6f));
  snapshot.object = ObjectId{object};
  snapshot.steps = steps;
  return snapshot;
}

mesh::MeshConfig CoarseMeshes() {
  mesh::MeshConfig config;
  config.resolution = config.min_side_nodes = 16;
  return config;
}

// The meshes that a session received.
class Received {
 public:
  Mesher::Sink Sink() {
    return [this](MeshUpdate mesh, const MeshPose& pose) {
      std::lock_guard lock(mutex_);
      meshes_.push_back(std::move(mesh));
      poses_.push_back(pose);
    };
  }
  std::vector<MeshUpdate> meshes() const {
    std::lock_guard lock(mutex_);
    return meshes_;
  }
  MeshPose pose(size_t index) const {
    std::lock_guard lock(mutex_);
    return poses_.at(index);
  }

 private:
  mutable std::mutex mutex_;
  std::vector<MeshUpdate> meshes_;
  std::vector<MeshPose> poses_;
};

TEST(MesherTest, OfferMakesTheMeshOnTheThreadOfTheCaller) {
  Received received;
  Mesher mesher(CoarseMeshes(), Mesher::Threading::kCaller);
  const Mesher::SessionId session = mesher.AddSession(received.Sink());
  FieldSnapshot snapshot = BallSnapshot(7, 40);
  snapshot.train_seconds = 1.5;
  snapshot.converged = true;
  snapshot.T_world_object = {Eigen::Quaterniond::Identity(), Eigen::Vector3d(1, 2, 3)};
  mesher.Offer(session, snapshot);
  ASSERT_EQ(received.meshes().size(), 1u);
  const MeshUpdate update = received.meshes()[0];
  EXPECT_EQ(update.id, ObjectId{7});
  EXPECT_EQ(update.steps, 40u);
  EXPECT_EQ(update.train_seconds, 1.5);
  EXPECT_TRUE(update.final);
  EXPECT_EQ(received.pose(0).T_world_mesh.translation(), Eigen::Vector3d(1, 2, 3));
  const auto mesh = DecodeDraco(update.draco);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->triangles.size(), update.triangle_count);
  for (const Eigen::Vector3f& p : mesh->vertices) EXPECT_NEAR(p.norm(), 0.6f, 0.05f);
}

TEST(MesherTest, AFieldWithoutSurfaceGivesNoMesh) {
  Received received;
  Mesher mesher(CoarseMeshes(), Mesher::Threading::kCaller);
  const Mesher::SessionId session = mesher.AddSession(received.Sink());
  FieldSnapshot snapshot = mesh::SnapshotOf([](const Eigen::Vector3f&) { return -1.0f; });
  mesher.Offer(session, snapshot);
  EXPECT_TRUE(received.meshes().empty());
}

TEST(MesherTest, RemovedSessionsReceiveNoMeshes) {
  Received received;
  Mesher mesher(CoarseMeshes(), Mesher::Threading::kCaller);
  const Mesher::SessionId session = mesher.AddSession(received.Sink());
  mesher.RemoveSession(session);
  mesher.Offer(session, BallSnapshot(1, 10));
  EXPECT_TRUE(received.meshes().empty());
  EXPECT_TRUE(mesher.IsIdle(session));
}

// A final mesh waits for a pause of its session, a mesh of a field that still trains does not.
TEST(MesherTest, FinalMeshesComeAfterOtherMeshes) {
  Received received;
  Mesher mesher(CoarseMeshes());
  const Mesher::SessionId session = mesher.AddSession(received.Sink());
  FieldSnapshot final = BallSnapshot(1, 100);
  final.converged = true;
  mesher.Offer(session, final);
  mesher.Offer(session, BallSnapshot(2, 10));
  ASSERT_TRUE(testing_support::Eventually([&] { return mesher.IsIdle(session); }));
  const std::vector<MeshUpdate> meshes = received.meshes();
  ASSERT_EQ(meshes.size(), 2u);
  EXPECT_EQ(meshes[0].id, ObjectId{2});
  EXPECT_EQ(meshes[1].id, ObjectId{1});
  EXPECT_TRUE(meshes[1].final);
}

// The mesh thread is blocked in the sink of another session while snapshots arrive.
// Another object of the session sends snapshots all the time.
TEST(MesherTest, AFinalMeshDoesNotWaitForever) {
  Received received;
  Mesher mesher(CoarseMeshes(), Mesher::Threading::kOwnThread,
                {.quiet = std::chrono::hours(1), .longest = std::chrono::milliseconds(100)});
  const Mesher::SessionId session = mesher.AddSession(received.Sink());
  FieldSnapshot final_snapshot = BallSnapshot(1, 40);
  final_snapshot.converged = true;
  mesher.Offer(session, final_snapshot);
  const auto has_final = [&] {
    const std::vector<MeshUpdate> meshes = received.meshes();
    return std::any_of(meshes.begin(), meshes.end(), [](const MeshUpdate& mesh) { return mesh.final; });
  };
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  for (uint64_t steps = 1; !has_final() && std::chrono::steady_clock::now() < deadline; ++steps) {
    mesher.Offer(session, BallSnapshot(2, steps));
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_TRUE(has_final());
}

TEST(MesherTest, OnlyTheNewestSnapshotOfAnObjectWaits) {
  Received received;
  std::promise<void> entered, release;
  Mesher mesher(CoarseMeshes());
  const Mesher::SessionId blocking = mesher.AddSession([&](MeshUpdate, const MeshPose&) {
    entered.set_value();
    release.get_future().wait();
  });
  const Mesher::SessionId session = mesher.AddSession(received.Sink());
  mesher.Offer(blocking, BallSnapshot(1, 10));
  const bool is_blocked = entered.get_future().wait_for(testing_support::kTimeout) == std::future_status::ready;
  EXPECT_TRUE(is_blocked) << "the mesh thread did not call the sink";
  mesher.Offer(session, BallSnapshot(2, 10));
  mesher.Offer(session, BallSnapshot(3, 10));
  mesher.Offer(session, BallSnapshot(2, 20));
  mesher.Offer(session, BallSnapshot(4, 10));
  mesher.RemoveObject(session, ObjectId{4});
  EXPECT_FALSE(mesher.IsIdle(session));
  release.set_value();
  ASSERT_TRUE(testing_support::Eventually([&] { return mesher.IsIdle(session); }));
  const std::vector<MeshUpdate> meshes = received.meshes();
  ASSERT_EQ(meshes.size(), 2u);
  EXPECT_EQ(meshes[0].id, ObjectId{2}) << "oldest first";
  EXPECT_EQ(meshes[0].steps, 20u);
  EXPECT_EQ(meshes[1].id, ObjectId{3});
}

}  // namespace romap::session::mesher_test
