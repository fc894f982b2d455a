#include "client/files/obj.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace romap::files::obj_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string TempPath(const std::string& name) {
  return testing::TempDir() + "romap_" + testing::UnitTest::GetInstance()->current_test_info()->name() + "_" + name;
}

std::string ErrorOf(const absl::Status& status) { return std::string(status.message()); }

TEST(ObjTest, ReadsPolygonsAndRelativeIndices) {
  const std::string path = TempPath("a.obj");
  std::ofstream(path) << "# quad\nmtllib a.mtl\nv 0 0 0 1 1 1\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\n"
                         "f 1//1 2//1 3//1 4//1\nf -4/1 -1 -2/2/1\n";
  const auto file = ReadObj(path);
  ASSERT_TRUE(file.ok()) << file.status();
  using Triangle = std::array<uint32_t, 3>;
  EXPECT_EQ(file->Position(2), Eigen::Vector3d(1, 1, 0));
  EXPECT_THAT(file->mesh.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 3, 2}));
  std::filesystem::remove(path);
}

TEST(ObjTest, KeepsTheShapeOfAMeshFarFromTheOrigin) {
  const std::string path = TempPath("far.obj");
  std::ofstream(path) << "v 500000.001 6400000.25 0\nv 500000.002 6400000.5 1\nv 500000.003 6400000 2\nf 1 2 3\n";
  const auto file = ReadObj(path);
  std::filesystem::remove(path);
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_LT((file->Position(1) - Eigen::Vector3d(500000.002, 6400000.5, 1)).norm(), 1e-8);
  EXPECT_NEAR(file->mesh.vertices[1].x() - file->mesh.vertices[0].x(), 1e-3, 1e-8);
}

TEST(ObjTest, NamesTheInvalidLineOrFace) {
  const std::string path = TempPath("a.obj");
  for (const auto& [text, message] : std::vector<std::pair<std::string, std::string>>{
           {"v 0 0\n", "a.obj:1: expected 'v x y z'"},
           {"v 0 0 0\nv nan 0 0\n", "a.obj:2"},
           {"v 0 0 0\nf 0 1 1\n", "a.obj: face 1: expected 'f a b c ...'"},
           {"v 0 0 0\nf -2 1 1\n", "a.obj: face 1"},
           {"v 0 0 0\nf 1 1\n", "a.obj: face 1"},
           {"v 0 0 0\nf 1 1 1\nf 1 x 1\n", "a.obj: face 2"},
           {"v 0 0 0\nf 1 1 9\n", "vertex index 8 in a face is out of range 0..0"},
           {"# nothing\n", "no vertices"}}) {
    std::ofstream(path) << text;
    EXPECT_THAT(ErrorOf(ReadObj(path).status()), HasSubstr(message));
  }
  std::filesystem::remove(path);
}

}  // namespace romap::files::obj_test
