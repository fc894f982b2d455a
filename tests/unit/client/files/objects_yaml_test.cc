#include "client/files/objects_yaml.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace romap::files::objects_yaml_test {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::string TempPath(const std::string& name) {
  return testing::TempDir() + "romap_" + testing::UnitTest::GetInstance()->current_test_info()->name() + "_" + name;
}

std::string ErrorOf(const absl::Status& status) { return std::string(status.message()); }

ObjectsYaml TwoObjects() {
  ObjectsYaml objects;
  objects.up_world = Eigen::Vector3d(0, 0.6, 0.8);
  objects.objects.push_back(
      {1,
       "the \"big\" cup: 1",
       "cup",
       {Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ())), Eigen::Vector3d(1, -2, 0.5)},
       Eigen::Vector3d(0.1, 0.2, 0.3),
       0.75});
  objects.objects.push_back({12, "plant", "potted plant", {}, Eigen::Vector3d(1, 1, 1), std::nullopt});
  return objects;
}

class ObjectsFormatTest : public testing::TestWithParam<const char*> {};

TEST_P(ObjectsFormatTest, RoundTrip) {
  const std::string path = testing::TempDir() + "romap_objects_roundtrip" + GetParam();
  const ObjectsYaml objects = TwoObjects();
  ASSERT_TRUE(WriteObjects(path, objects).ok());
  const auto read = ReadObjects(path);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_TRUE(read->up_world.isApprox(objects.up_world, 1e-8));
  ASSERT_EQ(read->objects.size(), 2u);
  for (size_t k = 0; k < 2; ++k) {
    const ObjectRecord& a = read->objects[k];
    const ObjectRecord& b = objects.objects[k];
    EXPECT_EQ(a.id, b.id);
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.class_name, b.class_name);
    EXPECT_TRUE(a.T_world_object.Matrix().isApprox(b.T_world_object.Matrix(), 1e-8));
    EXPECT_TRUE(a.half_extents.isApprox(b.half_extents, 1e-8));
    EXPECT_EQ(a.confidence, b.confidence);
  }
  std::filesystem::remove(path);
}

INSTANTIATE_TEST_SUITE_P(Formats, ObjectsFormatTest, testing::Values(".yaml", ".json"),
                         [](const auto& info) { return std::string(info.param).substr(1); });

TEST(ObjectsYamlTest, AcceptsAnEmptyMap) {
  const std::string path = TempPath("cuboids.json");
  ASSERT_TRUE(WriteObjects(path, {}).ok());
  const auto read = ReadObjects(path);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_TRUE(read->objects.empty());
  std::filesystem::remove(path);
}

TEST(ObjectsYamlTest, NamesTheInvalidObject) {
  const std::string path = TempPath("objects.yaml");
  const std::string head = "objects:\n  - id: 3\n    yaw: 0\n    center: [0, 0, 0]\n";
  const std::string matrix = "    T_world_object: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, ";
  for (const auto& [text, message] : std::vector<std::pair<std::string, std::string>>{
           {head, "objects.yaml:2: 'half_extents' is missing"},
           {head + "    half_extents: [1, -1, 1]\n", "objects.yaml:2: object 3: 'half_extents' must be positive"},
           {head + "    half_extents: [1, 1]\n", "to be a list of 3 numbers"},
           {head + "    half_extents: [1, .inf, 1]\n", "not a finite number"},
           {head + matrix + "2, 0, 0, 0, 0, 1]\n", "objects.yaml:5: the rotation"},
           {head + matrix + "-1, 0, 0, 0, 0, 1]\n", "right-handed"},
           {"objects:\n  - half_extents: [1, 1, 1]\n", "objects.yaml:2: 'id' is missing"},
           {"objects:\n  - 5\n", "entry 1 of 'objects' is not a YAML map"},
           {"world_up: [0, 0, 0]\nobjects:\n", "'world_up' must not be the zero vector"},
           {"cuboids: []\n", "the list 'objects:' is missing"},
           {"\x01\x02\xff", "objects.yaml"}}) {
    std::ofstream(path) << text;
    EXPECT_THAT(ErrorOf(ReadObjects(path).status()), AllOf(HasSubstr("objects.yaml"), HasSubstr(message)));
  }
  std::filesystem::remove(path);
}

}  // namespace romap::files::objects_yaml_test
