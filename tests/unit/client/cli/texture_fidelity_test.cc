#include "client/cli/texture_fidelity.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "client/files/text_file.h"
#include "client/render/mesh_view.h"
#include "tests/support/subprocess.h"

namespace romap::cli::texture_fidelity_test {

// Two frames of a gray square of 1 m at a distance of 2 m. Its mask is exact; the rest of the images is white.
class TextureFidelityTest : public ::testing::Test {
 protected:
  TextureFidelityTest() {
    for (const char* folder : {"rgb", "mask"}) EXPECT_TRUE(files::MakeFolder(folder_ / folder).ok());
    Put("camera.yaml", "width: 64\nheight: 48\nfx: 60\nfy: 60\ncx: 31.5\ncy: 23.5\nfps: 10\n");
    Put("rgb.txt", "0.0 rgb/0.png\n0.1 rgb/1.png\n");
    Put("mask.txt", "0.0 mask/0.png\n0.1 mask/1.png\n");
    Put("groundtruth.txt", "0.0 0 0 0 0 0 0 1\n0.1 0 0 0 0 0 0 1\n");
    const MapObject truth = Square(100);
    const render::MeshInstance instance{.mesh = &truth.mesh, .id = 3, .S_world_mesh = truth.S_world_mesh};
    const auto view = render::RenderMeshes(std::span(&instance, 1), Camera(), {}, render::MeshPaint::kColored);
    for (const char* name : {"/0.png", "/1.png"}) {
      cv::imwrite(folder_ / "rgb" + name, view.color_bgr);
      cv::imwrite(folder_ / "mask" + name, view.ids);
    }
  }

  static CameraModel Camera() {
    return {.width_px = 64, .height_px = 48, .fx_px = 60, .fy_px = 60, .cx_px = 31.5, .cy_px = 23.5};
  }

  static MapObject Square(uint8_t gray) {
    MapObject object;
    object.file_stem = "1_square";
    object.mesh.vertices = {{-0.5F, -0.5F, 0}, {-0.5F, 0.5F, 0}, {0.5F, 0.5F, 0}, {0.5F, -0.5F, 0}};
    object.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    object.mesh.colors.assign(4, Rgb8{gray, gray, gray});
    object.S_world_mesh = {1, Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 2)};
    return object;
  }

  std::vector<TextureFidelity> Measure(const std::vector<MapObject>& objects) {
    const auto sequence = files::Sequence::Open(folder_.path());
    EXPECT_TRUE(sequence.ok()) << sequence.status();
    const std::vector<size_t> frames = {0, 1};
    return MeasureTextures(objects, *sequence, frames);
  }

  void Put(const std::string& name, const std::string& text) {
    ASSERT_TRUE(files::WriteFile(folder_ / name, text).ok());
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(TextureFidelityTest, TheTrueColorsAreExact) {
  const auto textures = Measure({Square(100)});
  ASSERT_EQ(textures.size(), 1u);
  EXPECT_EQ(textures[0].object, "1_square");
  EXPECT_EQ(textures[0].frames, 2u);
  EXPECT_GT(textures[0].psnr_db, 70);
  EXPECT_GT(textures[0].pixels, 2u * 20 * 20);
}

TEST_F(TextureFidelityTest, AnErrorOfTenLevelsIs28Decibels) {
  const auto textures = Measure({Square(110)});
  ASSERT_EQ(textures.size(), 1u);
  EXPECT_NEAR(textures[0].psnr_db, 28.13, 0.05);
  EXPECT_NEAR(*MeanPsnr_db(textures), 28.13, 0.05);
}

TEST_F(TextureFidelityTest, PixelsOutsideOfTheMaskDoNotCount) {
  MapObject large = Square(100);
  for (Eigen::Vector3f& vertex : large.mesh.vertices) vertex *= 1.2F;  // covers the white background
  const auto textures = Measure({large});
  ASSERT_EQ(textures.size(), 1u);
  EXPECT_GT(textures[0].psnr_db, 70);
}

TEST_F(TextureFidelityTest, AnObjectThatNoFrameShowsIsLeftOut) {
  MapObject behind = Square(100);
  behind.S_world_mesh = {1, Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, -2)};
  EXPECT_TRUE(Measure({behind}).empty());
  EXPECT_FALSE(MeanPsnr_db({}).has_value());
}

}  // namespace romap::cli::texture_fidelity_test
