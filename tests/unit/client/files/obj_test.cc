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
  const auto mesh = ReadObj(path);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  using Triangle = std::array<uint32_t, 3>;
  EXPECT_THAT(mesh->triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 3, 2}));
  std::filesystem::remove(path);
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
