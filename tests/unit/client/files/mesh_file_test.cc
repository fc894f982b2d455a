#include "client/files/mesh_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "client/files/ply.h"

namespace romap::files::mesh_file_test {

using ::testing::HasSubstr;

std::string TempPath(const std::string& name) {
  return testing::TempDir() + "romap_" + testing::UnitTest::GetInstance()->current_test_info()->name() + "_" + name;
}

std::string ErrorOf(const absl::Status& status) { return std::string(status.message()); }

Mesh Tetrahedron() {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.normals = {{0, 0, -1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.colors = {{1, 2, 3}, {250, 251, 252}, {0, 0, 0}, {255, 255, 255}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return mesh;
}

TEST(MeshFolderTest, ReadsMeshesByName) {
  const std::string dir = TempPath("folder");
  std::filesystem::create_directories(dir);
  EXPECT_THAT(ErrorOf(ReadMeshFolder(dir).status()), HasSubstr("no .ply or .obj files"));
  ASSERT_TRUE(WritePly(dir + "/cup.PLY", Tetrahedron()).ok());
  std::ofstream(dir + "/notes.txt") << "not a mesh";
  const auto meshes = ReadMeshFolder(dir);
  ASSERT_TRUE(meshes.ok()) << meshes.status();
  EXPECT_EQ(meshes->size(), 1u);
  EXPECT_TRUE(meshes->contains("cup"));
  std::ofstream(dir + "/cup.obj") << "v 0 0 0\n";
  EXPECT_THAT(ErrorOf(ReadMeshFolder(dir).status()), HasSubstr("two meshes are named cup"));
  EXPECT_THAT(ErrorOf(ReadMeshFolder(dir + "/nowhere").status()), HasSubstr("cannot read: No such file or directory"));
  EXPECT_THAT(ErrorOf(ReadMeshFile(dir + "/notes.txt").status()), HasSubstr("expected a .ply or .obj file"));
  std::filesystem::remove_all(dir);
}

TEST(MeshFileDataTest, ReadsGroundTruthClouds) {
  const char* data_dir = std::getenv("ROMAP_DATA_DIR");
  if (data_dir == nullptr) GTEST_SKIP() << "ROMAP_DATA_DIR is not set";
  const auto cup = ReadMeshFile(std::string(data_dir) + "/cube_diorama_room/gt/cup.ply");
  ASSERT_TRUE(cup.ok()) << cup.status();
  EXPECT_EQ(cup->mesh.vertices.size(), 28754u);
  EXPECT_EQ(cup->scalars.at("source").size(), 28754u);
}

}  // namespace romap::files::mesh_file_test
