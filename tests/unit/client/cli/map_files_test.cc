#include "client/cli/map_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

TEST(MapFilesTest, TransformsAndScalesMeshesToTheWorldFrame) {
  const auto draco = EncodeDraco(Tetrahedron(), DracoOptions{});
  ASSERT_TRUE(draco.ok());
  ObjectSnapshot snapshot;
  snapshot.object.id = ObjectId{1};
  snapshot.object.state = ObjectState::kConfirmed;
  snapshot.object.T_world_mesh.emplace(Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitX())),
                                       Eigen::Vector3d(10, 20, 30));
  snapshot.mesh.emplace();
  snapshot.mesh->draco = *draco;

  std::vector<std::string> faults;
  const std::vector<MapObject> plain = DecodeObjects({snapshot}, &faults);
  snapshot.object.mesh_scale = 1.5;
  const std::vector<MapObject> scaled = DecodeObjects({snapshot}, &faults);
  EXPECT_THAT(faults, IsEmpty());
  const Eigen::Vector3f origin(10, 20, 30);
  ASSERT_THAT(scaled.at(0).mesh_world.vertices, SizeIs(4));
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3f expected = origin + 1.5f * (plain.at(0).mesh_world.vertices[i] - origin);
    EXPECT_LT((scaled[0].mesh_world.vertices[i] - expected).norm(), 1e-4f);
    EXPECT_LT((scaled[0].mesh_world.normals[i] - plain[0].mesh_world.normals[i]).norm(), 1e-5f);
  }
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
