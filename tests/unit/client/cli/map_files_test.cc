#include "client/cli/map_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "client/files/ply.h"
#include "common/mesh_codec.h"

namespace romap::cli::map_files_test {

using ::testing::IsEmpty;
using ::testing::SizeIs;

Mesh Tetrahedron() {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.normals.assign(4, {0, 0, 1});
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
  return mesh;
}

ObjectSnapshot SnapshotAt(const Eigen::Vector3d& origin_world) {
  ObjectSnapshot snapshot;
  snapshot.object.id = ObjectId{1};
  snapshot.object.state = ObjectState::kConfirmed;
  snapshot.object.T_world_mesh.emplace(Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitX())),
                                       origin_world);
  snapshot.object.mesh_scale = 1.5;
  snapshot.mesh.emplace();
  snapshot.mesh->draco = EncodeDraco(Tetrahedron(), DracoOptions{}).value();
  return snapshot;
}

TEST(MapFilesTest, WritesMeshesFarFromTheOriginWithTheirFullShape) {
  const std::string dir = testing::TempDir() + "romap_map_files_test";
  for (const Eigen::Vector3d& origin : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(500'000.123, -6'400'000, 100)}) {
    const ObjectSnapshot snapshot = SnapshotAt(origin);
    std::vector<std::string> faults;
    const std::vector<MapObject> objects = DecodeObjects({snapshot}, &faults);
    EXPECT_THAT(faults, IsEmpty());
    ASSERT_TRUE(WriteMapFiles(dir, objects).ok());
    const auto file = files::ReadPly(dir + "/objects/1_.ply");
    ASSERT_TRUE(file.ok()) << file.status();
    const Mesh& local = objects.at(0).mesh;
    ASSERT_THAT(local.vertices, SizeIs(4));
    const Eigen::Quaterniond& rotation = snapshot.object.T_world_mesh->rotation();
    for (size_t i = 0; i < 4; ++i) {
      const Eigen::Vector3d from_origin = rotation * (1.5 * local.vertices[i].cast<double>());
      EXPECT_LT((file->Position(i) - origin - from_origin).norm(), 1e-6);
      EXPECT_LT((file->mesh.normals[i].cast<double>() - rotation * local.normals[i].cast<double>()).norm(), 1e-6);
    }
  }
  std::filesystem::remove_all(dir);
}

TEST(MapFilesTest, WritesObjFilesOnRequestAndRemovesThoseOfAnEarlierRun) {
  const std::string dir = testing::TempDir() + "romap_map_files_obj_test";
  std::vector<std::string> faults;
  std::vector<MapObject> objects = DecodeObjects({SnapshotAt({1, 2, 3})}, &faults);
  objects.at(0).mesh.uv.assign(4, {0.5F, 0.5F});
  objects.at(0).texture = {.image = "bytes of an image", .media_type = "image/png"};
  ASSERT_TRUE(WriteMapFiles(dir, objects, {.obj = true}).ok());
  const std::vector<std::string> names = {"1_.obj", "1_.mtl", "1_.png"};
  for (const std::string& name : names) EXPECT_TRUE(std::filesystem::exists(dir + "/objects/" + name)) << name;
  ASSERT_TRUE(WriteMapFiles(dir, objects).ok());
  for (const std::string& name : names) EXPECT_FALSE(std::filesystem::exists(dir + "/objects/" + name)) << name;
  EXPECT_TRUE(std::filesystem::exists(dir + "/objects/1_.glb"));
  std::filesystem::remove_all(dir);
}

TEST(MapFilesTest, TrajectorySkipsFramesWithoutPose) {
  MapSnapshot snapshot;
  FrameAck tracked, untracked;
  tracked.T_world_camera.emplace(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1, 2, 3));
  snapshot.trajectory = {untracked, tracked};
  snapshot.timestamps_ns = {10, 20};
  const std::vector<files::StampedPose> trajectory = TrajectoryOf(snapshot);
  ASSERT_THAT(trajectory, SizeIs(1));
  EXPECT_EQ(trajectory[0].timestamp_ns, 20);
  EXPECT_EQ(trajectory[0].T_world_camera.translation(), Eigen::Vector3d(1, 2, 3));
}

}  // namespace romap::cli::map_files_test
