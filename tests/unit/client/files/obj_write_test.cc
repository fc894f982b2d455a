#include "client/files/obj_write.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tiny_obj_loader.h>

#include "client/files/obj.h"
#include "client/files/text_file.h"
#include "tests/support/subprocess.h"

namespace romap::files::obj_write_test {

using ::testing::HasSubstr;

Mesh Square() {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  mesh.normals.assign(4, {0, 0, 1});
  mesh.colors.assign(4, Rgb8{255, 0, 51});
  mesh.uv = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

const MeshTexture kTexture{.image = "bytes of an image", .media_type = "image/jpeg"};

class ObjWriteTest : public ::testing::Test {
 protected:
  // As a foreign reader sees the file.
  tinyobj::ObjReader Load() const {
    tinyobj::ObjReader reader;
    EXPECT_TRUE(reader.ParseFromFile(path())) << reader.Error();
    EXPECT_EQ(reader.Warning(), "");
    return reader;
  }
  std::string path() const { return folder_ / "square.obj"; }

  testing_support::TemporaryFolder folder_;
};

TEST_F(ObjWriteTest, PlacesTheMeshInTheWorld) {
  const Sim3<World, Object> S_world_mesh(2.0, Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX())),
                                         Eigen::Vector3d(640'000, 0, 5));
  ASSERT_TRUE(WriteObj(path(), Square(), S_world_mesh).ok());
  const auto file = ReadObj(path());
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_TRUE(file->Position(2).isApprox(Eigen::Vector3d(640'002, 0, 7), 1e-8)) << file->Position(2).transpose();
  EXPECT_EQ(file->mesh.triangles, Square().triangles);
  EXPECT_NEAR(Load().GetAttrib().normals[1], -1, 1e-4);  // z of the mesh is -y of the world
}

TEST_F(ObjWriteTest, ATextureIsNamedByItsMaterial) {
  ASSERT_TRUE(WriteObj(path(), Square(), {}, kTexture).ok());
  const tinyobj::ObjReader reader = Load();
  ASSERT_EQ(reader.GetMaterials().size(), 1u);
  EXPECT_EQ(reader.GetMaterials()[0].diffuse_texname, "square.jpg");
  EXPECT_EQ(ReadFile(folder_ / "square.jpg").value_or(""), kTexture.image);
  const std::vector<float>& uv = reader.GetAttrib().texcoords;
  ASSERT_EQ(uv.size(), 8u);
  EXPECT_EQ(uv[1], 0);  // the lower edge of the image: v counts upwards
  EXPECT_EQ(uv[5], 1);
  EXPECT_EQ(reader.GetShapes()[0].mesh.material_ids, (std::vector<int>{0, 0}));
}

TEST_F(ObjWriteTest, WithoutATextureVerticesHaveColors) {
  Mesh mesh = Square();
  mesh.uv.clear();
  ASSERT_TRUE(WriteObj(path(), mesh).ok());
  const tinyobj::ObjReader reader = Load();
  ASSERT_EQ(reader.GetAttrib().colors.size(), 12u);
  EXPECT_NEAR(reader.GetAttrib().colors[2], 0.2, 1e-4);
  EXPECT_FALSE(ReadFile(folder_ / "square.mtl").ok());
}

TEST_F(ObjWriteTest, RefusesAnIncompleteMeshAndAnUnknownTexture) {
  Mesh mesh = Square();
  mesh.uv.pop_back();
  EXPECT_THAT(WriteObj(path(), mesh).message(), HasSubstr("must be absent or 4, not 3"));
  EXPECT_THAT(WriteObj(path(), Square(), {}, {.image = "x", .media_type = "image/tiff"}).message(),
              HasSubstr("image/tiff"));
}

}  // namespace romap::files::obj_write_test
