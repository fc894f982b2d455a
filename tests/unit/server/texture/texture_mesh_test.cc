#include "server/texture/texture_mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "tests/unit/server/texture/rendered_views.h"
#include "tests/unit/server/texture/texture_scenes.h"

namespace romap::texture::texture_mesh_test {

void ExpectSharpTexture(const char* what, const Mesh& mesh, const SolidShape& shape) {
  SCOPED_TRACE(what);
  const SolidTexture color = Checker();
  const std::vector<TextureView> views = PhotographAll(PosesAround(24, 5, 0), shape, color);
  const std::vector<TextureView> held_out = PhotographAll(PosesAround(7, 5, 0.31), shape, color);
  const absl::StatusOr<TexturedObject> object = TextureMesh(mesh, views, {});
  ASSERT_TRUE(object.ok()) << object.status();
  const TexturedMesh& textured = object->textured;
  EXPECT_LE(textured.mesh.triangles.size(), 8000u);
  EXPECT_EQ(object->media_type, "image/jpeg");
  const cv::Mat texture = cv::imdecode(object->image, cv::IMREAD_COLOR);
  ASSERT_EQ(texture.size(), cv::Size(textured.atlas_px, textured.atlas_px));
  const double psnr = PsnrOfViews(textured.mesh, ColorOfTexture(textured, texture), held_out);
  // Colors of 8000 triangles, whatever the number of triangles of the textured mesh.
  const double vertex_psnr = PsnrOfViews(mesh, ColorOfVertices(mesh, color), held_out);
  std::printf(
      "%s: %.2f dB, vertex colors %.2f dB; %zu -> %zu triangles, %zu vertices, error %g, atlas %d px, %zu bytes, seen "
      "%.3f; simplify %.0f unwrap %.0f bake %.0f encode %.0f ms\n",
      what, psnr, vertex_psnr, mesh.triangles.size(), textured.mesh.triangles.size(), textured.mesh.vertices.size(),
      object->error_mu, textured.atlas_px, object->image.size(), object->seen_share, object->times.simplify_s * 1e3,
      object->times.unwrap_s * 1e3, object->times.bake_s * 1e3, object->times.encode_s * 1e3);
  EXPECT_GE(psnr, 28);
  EXPECT_GE(psnr, vertex_psnr + 4);
  EXPECT_GT(object->seen_share, 0.95);
  EXPECT_LT(object->image.size(), 400'000u);
}

TEST(TextureMeshTest, HeldOutViewsOfASphereAreSharp) { ExpectSharpTexture("sphere", SphereMesh(36), SolidSphere()); }

TEST(TextureMeshTest, HeldOutViewsOfABoxAreSharp) {
  const Eigen::Vector3d half_extents(0.9, 0.7, 0.5);
  ExpectSharpTexture("box", BoxMesh(36, half_extents), SolidBox(half_extents));
}

}  // namespace romap::texture::texture_mesh_test
