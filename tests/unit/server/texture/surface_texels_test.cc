#include "server/texture/surface_texels.h"

#include <gtest/gtest.h>

#include <set>

#include "server/texture/mesh_edges.h"
#include "tests/unit/server/texture/texture_scenes.h"

namespace romap::texture::surface_texels_test {

TEST(SurfaceTexelsTest, TexelsCoverTheChartsAndTwoTexelsBesideThem) {
  Mesh square;
  square.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  square.triangles = {{0, 1, 2}, {0, 2, 3}};
  const TexturedMesh textured = *UnwrapMesh(square, {.texels_per_mu = 40, .padding_px = 4});
  std::set<uint32_t> indices;
  for (const SurfaceTexel& texel : FindSurfaceTexels(textured)) {
    EXPECT_TRUE(indices.insert(texel.index).second);
    EXPECT_TRUE(texel.normal.isApprox(Eigen::Vector3f::UnitZ()));
    EXPECT_NEAR(texel.position.z(), 0, 1e-6);
    // At the border of the mesh, the texels beside it show the border.
    EXPECT_GE(texel.position.head<2>().minCoeff(), -1e-5f);
    EXPECT_LE(texel.position.head<2>().maxCoeff(), 1 + 1e-5f);
  }
  EXPECT_NEAR(static_cast<double>(indices.size()), 44 * 44, 100);
}

TEST(SurfaceTexelsTest, PositionsAreThoseOfTheTextureCoordinates) {
  Mesh sphere = SphereMesh(16);
  SetAngleWeightedNormals(sphere);
  const TexturedMesh textured = *UnwrapMesh(sphere, {.texels_per_mu = 60});
  const std::vector<SurfaceTexel> texels = FindSurfaceTexels(textured);
  EXPECT_GT(texels.size(), 30'000u);
  for (const SurfaceTexel& texel : texels) {
    Eigen::Vector2f uv = Eigen::Vector2f::Zero();
    Eigen::Vector3f position = Eigen::Vector3f::Zero();
    for (int i = 0; i < 3; ++i) {
      uv += texel.barycentric[i] * textured.mesh.uv[textured.mesh.triangles[texel.face][i]];
      position += texel.barycentric[i] * textured.mesh.vertices[textured.mesh.triangles[texel.face][i]];
    }
    ASSERT_LT((position - texel.position).norm(), 1e-5f);
    // The sphere is smooth, so the surface is continued beside all charts.
    const auto side = static_cast<uint32_t>(textured.atlas_px);
    ASSERT_NEAR(uv.x() * static_cast<float>(side) - 0.5f, static_cast<float>(texel.index % side), 0.02);
    ASSERT_NEAR(uv.y() * static_cast<float>(side) - 0.5f, static_cast<float>(texel.index / side), 0.02);
    ASSERT_NEAR(texel.position.norm(), 1, 0.02);
    ASSERT_GT(texel.normal.dot(texel.position), 0.98f);
  }
}

// Beyond a sharp edge there is no surface.
TEST(SurfaceTexelsTest, PointsOfABoxAreOnTheBox) {
  Mesh box = BoxMesh(6, {1, 1, 1});
  for (const SurfaceTexel& texel : FindSurfaceTexels(*UnwrapMesh(box, {.texels_per_mu = 50}))) {
    ASSERT_NEAR(texel.position.lpNorm<Eigen::Infinity>(), 1, 1e-4);
  }
}

}  // namespace romap::texture::surface_texels_test
