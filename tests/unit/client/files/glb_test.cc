#include "client/files/glb.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "client/files/text_file.h"
#include "common/gltf/glb.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"

namespace romap::files::glb_test {

TEST(GlbFileTest, HasTheEncodedMesh) {
  const testing_support::TemporaryFolder folder;
  Mesh mesh;
  mesh.vertices = {{0, 0, -1}, {2, 0, 0}, {0, 3, 0}};
  mesh.triangles = {{0, 1, 2}};
  const Sim3<World, Object> S_world_mesh(2, Eigen::Quaterniond::Identity(), Eigen::Vector3d(1, 2, 3));
  EXPECT_OK(WriteGlb(folder / "cup.glb", mesh, S_world_mesh));
  const GlbObject object{.mesh = &mesh, .S_world_mesh = S_world_mesh};
  EXPECT_EQ(ReadFile(folder / "cup.glb").value(), EncodeGlb({&object, 1}, "cup").value());
}

TEST(GlbFileTest, AnInvalidMeshGivesNoFile) {
  const testing_support::TemporaryFolder folder;
  const absl::Status status = WriteGlb(folder / "cup.glb", Mesh());
  EXPECT_EQ(Message(status), (folder / "cup.glb") + ": no vertices");
  EXPECT_FALSE(std::filesystem::exists(folder / "cup.glb"));
}

}  // namespace romap::files::glb_test
