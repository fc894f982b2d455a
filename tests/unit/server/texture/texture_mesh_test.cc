#include "server/texture/texture_mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/unit/server/texture/rendered_views.h"
#include "tests/unit/server/texture/texture_scenes.h"

namespace romap::texture::texture_mesh_test {

cv::Mat Decode(const MeshTexture& texture) {
  return cv::imdecode(std::vector<uint8_t>(texture.image.begin(), texture.image.end()), cv::IMREAD_COLOR);
}

void ExpectSharpTexture(const char* what, const Mesh& mesh, const SolidShape& shape) {
  SCOPED_TRACE(what);
  const SolidTexture color = Checker();
  const std::vector<TrainingCamera> views = PhotographAll(PosesAround(24, 5, 0), shape, color);
  const std::vector<TrainingCamera> held_out = PhotographAll(PosesAround(7, 5, 0.31), shape, color);
  const absl::StatusOr<TexturedObject> object = TextureMesh(mesh, views, {});
  ASSERT_TRUE(object.ok()) << object.status();
  const TexturedMesh& textured = object->textured;
  EXPECT_LE(textured.mesh.triangles.size(), 8000u);
  EXPECT_EQ(object->texture.media_type, "image/jpeg");
  const cv::Mat texture = Decode(object->texture);
  ASSERT_EQ(texture.size(), cv::Size(textured.atlas_px, textured.atlas_px));
  const double psnr = PsnrOfViews(textured.mesh, ColorOfTexture(textured, texture), held_out);
  // Colors of 8000 triangles, whatever the number of triangles of the textured mesh.
  const double vertex_psnr = PsnrOfViews(mesh, ColorOfVertices(mesh, color), held_out);
  std::printf(
      "%s: %.2f dB, vertex colors %.2f dB; %zu -> %zu triangles, %zu vertices, error %g, atlas %d px, %zu bytes, seen "
      "%.3f; simplify %.0f unwrap %.0f bake %.0f encode %.0f ms\n",
      what, psnr, vertex_psnr, mesh.triangles.size(), textured.mesh.triangles.size(), textured.mesh.vertices.size(),
      object->error_mu, textured.atlas_px, object->texture.image.size(), object->seen_share,
      object->times.simplify_s * 1e3, object->times.unwrap_s * 1e3, object->times.bake_s * 1e3,
      object->times.encode_s * 1e3);
  EXPECT_GE(psnr, 28);
  EXPECT_GE(psnr, vertex_psnr + 4);
  EXPECT_GT(object->seen_share, 0.95);
  EXPECT_LT(object->texture.image.size(), 400'000u);
}

TEST(TextureMeshTest, HeldOutViewsOfASphereAreSharp) { ExpectSharpTexture("sphere", SphereMesh(36), SolidSphere()); }

TEST(TextureMeshTest, HeldOutViewsOfABoxAreSharp) {
  const Eigen::Vector3d half_extents(0.9, 0.7, 0.5);
  ExpectSharpTexture("box", BoxMesh(36, half_extents), SolidBox(half_extents));
}

// A large object whose surface is as rough as that of a trained field, with many views.
TEST(TextureMeshTest, AnObjectStaysSmall) {
  const Mesh mesh = RoughMesh(50);
  ASSERT_EQ(mesh.triangles.size(), 30'000u);
  const std::vector<TrainingCamera> views = PhotographAll(PosesAround(20, 5, 0), SolidSphere(), Checker());
  std::vector<TrainingCamera> many;
  for (int i = 0; i < 3; ++i) many.insert(many.end(), views.begin(), views.end());
  const absl::StatusOr<TexturedObject> object = TextureMesh(mesh, many, {});
  ASSERT_TRUE(object.ok()) << object.status();
  const TextureTimes& times = object->times;
  // Positions and texture coordinates as floats, indices with 16 bits.
  const size_t mesh_bytes = object->textured.mesh.vertices.size() * 20 + object->textured.mesh.triangles.size() * 6;
  std::printf(
      "30000 triangles, 60 views: simplify %.0f unwrap %.0f bake %.0f encode %.0f ms, atlas %d px, %zu bytes of "
      "image, %zu of mesh\n",
      times.simplify_s * 1e3, times.unwrap_s * 1e3, times.bake_s * 1e3, times.encode_s * 1e3, object->textured.atlas_px,
      object->texture.image.size(), mesh_bytes);
  EXPECT_LE(object->textured.mesh.triangles.size(), 8000u);
  EXPECT_LE(object->textured.atlas_px, 1024);
  EXPECT_LT(object->texture.image.size() + mesh_bytes, 600'000u);
  // Loose, because tests run on busy machines and with sanitizers.
  EXPECT_LT(times.simplify_s + times.unwrap_s + times.bake_s + times.encode_s, 60);
}

TEST(TextureMeshTest, PngIsExact) {
  const std::vector<TrainingCamera> views = PhotographAll(PosesAround(6, 5, 0), SolidSphere(), Checker());
  const absl::StatusOr<TexturedObject> jpeg = TextureMesh(SphereMesh(12), views, {});
  const absl::StatusOr<TexturedObject> png = TextureMesh(SphereMesh(12), views, {.use_png = true});
  ASSERT_TRUE(jpeg.ok() && png.ok());
  EXPECT_EQ(png->texture.media_type, "image/png");
  const cv::Mat exact = Decode(png->texture), lossy = Decode(jpeg->texture);
  EXPECT_GT(cv::PSNR(exact, lossy), 32);
  EXPECT_GT(png->texture.image.size(), 2 * jpeg->texture.image.size());
}

TEST(TextureMeshTest, ViewsFromOneSideSeeHalfOfTheSurface) {
  const absl::StatusOr<TexturedObject> object =
      TextureMesh(SphereMesh(16), PhotographAll({LookAtOrigin({5, 0, 0})}, SolidSphere(), Checker()), {});
  ASSERT_TRUE(object.ok());
  EXPECT_GT(object->seen_share, 0.2);
  EXPECT_LT(object->seen_share, 0.45);
}

TEST(TextureMeshTest, WithoutViewsTheTextureShowsTheVertexColors) {
  Mesh mesh = SphereMesh(12);
  mesh.colors.assign(mesh.vertices.size(), {200, 100, 50});
  const absl::StatusOr<TexturedObject> object = TextureMesh(mesh, {}, {});
  ASSERT_TRUE(object.ok()) << object.status();
  EXPECT_EQ(object->seen_share, 0);
  EXPECT_EQ(object->textured.atlas_px, 256);
  const cv::Mat texture = Decode(object->texture);
  EXPECT_LT(cv::norm(texture, cv::Mat(texture.size(), CV_8UC3, cv::Scalar(50, 100, 200)), cv::NORM_INF), 4);
}

TEST(TextureMeshTest, OneTriangle) {
  Mesh triangle;
  triangle.vertices = {{0.99f, -0.3f, -0.3f}, {0.99f, 0.3f, -0.3f}, {0.99f, 0, 0.4f}};
  triangle.triangles = {{0, 1, 2}};
  const absl::StatusOr<TexturedObject> object =
      TextureMesh(triangle, PhotographAll({LookAtOrigin({5, 0, 0})}, SolidSphere(), Checker()), {});
  ASSERT_TRUE(object.ok()) << object.status();
  EXPECT_EQ(object->textured.mesh.triangles.size(), 1u);
  EXPECT_EQ(object->seen_share, 1);
}

TEST(TextureMeshTest, InvalidInputIsExplained) {
  const auto message = [](const Mesh& mesh, const std::vector<TrainingCamera>& views, const TextureOptions& options) {
    const absl::Status status = TextureMesh(mesh, views, options).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    return std::string(status.message());
  };
  EXPECT_EQ(message({}, {}, {}), "the mesh has no triangles, must have at least one");
  Mesh mesh = SphereMesh(4);
  mesh.vertices[7].y() = std::numeric_limits<float>::infinity();
  EXPECT_THAT(message(mesh, {}, {}), testing::HasSubstr("vertex 7 of the mesh is at ("));
  EXPECT_THAT(message(mesh, {}, {}), testing::HasSubstr("must be finite and within 1000000000 of the origin"));
  mesh = SphereMesh(4);
  mesh.triangles[5][1] = 1000;
  EXPECT_EQ(message(mesh, {}, {}), "triangle 5 of the mesh has vertex 1000, must be below 98");
  mesh = SphereMesh(4);
  mesh.colors.resize(3);
  EXPECT_EQ(message(mesh, {}, {}), "the mesh has 3 colors, must have none or one for each of the 98 vertices");
  mesh = SphereMesh(4);
  std::vector<TrainingCamera> views(2, Photograph(LookAtOrigin({5, 0, 0}), SolidSphere(), Checker()));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  views[1].T_camera_object = SE3<Camera, Object>(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, nan, 0));
  EXPECT_EQ(message(mesh, views, {}), "view 1: the pose is not finite");
  EXPECT_EQ(message(mesh, {}, {.max_error_share = NAN}), "max_error_share is nan, must be at least 0");
  EXPECT_EQ(message(mesh, {}, {.max_atlas_px = 20}), "max_atlas_px is 20, must be 64..8192");
  EXPECT_EQ(message(mesh, {}, {.texels_per_pixel = 0}), "texels_per_pixel is 0, must be above 0");
  EXPECT_EQ(message(mesh, {}, {.jpeg_quality = 0}), "jpeg_quality is 0, must be 1..100");
}

}  // namespace romap::texture::texture_mesh_test
