#include "server/texture/fill_unseen.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "tests/unit/server/texture/texture_scenes.h"

namespace romap::texture::fill_unseen_test {

TEST(FillUnseenTest, ColorsContinueAcrossTheBordersOfCharts) {
  const TexturedMesh textured = *UnwrapMesh(SphereMesh(16), {.texels_per_mu = 40});
  const std::vector<SurfaceTexel> texels = FindSurfaceTexels(textured);
  cv::Mat color_bgr(textured.atlas_px, textured.atlas_px, CV_8UC3, cv::Scalar::all(7));
  cv::Mat seen = cv::Mat::zeros(color_bgr.size(), CV_8UC1);
  auto* colors = reinterpret_cast<cv::Vec3b*>(color_bgr.data);
  // A hole of radius 0.5 around +x+y+z, across several charts; the color increases along z.
  const auto expected = [](const Eigen::Vector3f& p) { return 128 + 60 * p.z(); };
  const auto is_hole = [](const Eigen::Vector3f& p) { return (p - Eigen::Vector3f::Constant(0.577f)).norm() < 0.5f; };
  for (const SurfaceTexel& texel : texels) {
    if (is_hole(texel.position)) continue;
    seen.data[texel.index] = 255;
    colors[texel.index] = cv::Vec3b(static_cast<uint8_t>(expected(texel.position)), 50, 200);
  }
  FillUnseen(textured, texels, seen, color_bgr);
  size_t holes = 0;
  for (const SurfaceTexel& texel : texels) {
    const cv::Vec3b& color = colors[texel.index];
    ASSERT_NEAR(color[0], expected(texel.position), is_hole(texel.position) ? 12 : 1.5);
    ASSERT_NEAR(color[1], 50, 1);
    ASSERT_NEAR(color[2], 200, 1);
    holes += is_hole(texel.position);
  }
  EXPECT_GT(holes, 500u);
}

TEST(FillUnseenTest, TexelsBetweenChartsHaveTheColorsAroundThem) {
  const TexturedMesh textured = *UnwrapMesh(SphereMesh(16), {.texels_per_mu = 40});
  const std::vector<SurfaceTexel> texels = FindSurfaceTexels(textured);
  cv::Mat color_bgr(textured.atlas_px, textured.atlas_px, CV_8UC3, cv::Scalar::all(7));
  cv::Mat seen = cv::Mat::zeros(color_bgr.size(), CV_8UC1);
  for (const SurfaceTexel& texel : texels) {
    seen.data[texel.index] = 255;
    reinterpret_cast<cv::Vec3b*>(color_bgr.data)[texel.index] = cv::Vec3b(10, 100, 200);
  }
  FillUnseen(textured, texels, seen, color_bgr);
  EXPECT_EQ(cv::norm(color_bgr, cv::Mat(color_bgr.size(), CV_8UC3, cv::Scalar(10, 100, 200)), cv::NORM_INF), 0);
}

// A part of the mesh that no seen part is connected to keeps its vertex colors.
TEST(FillUnseenTest, UnconnectedPartsKeepTheirVertexColors) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {5, 0, 0}, {6, 0, 0}, {5, 1, 0}};
  mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
  mesh.colors.assign(6, {30, 60, 90});
  const TexturedMesh textured = *UnwrapMesh(mesh, {.texels_per_mu = 30});
  const std::vector<SurfaceTexel> texels = FindSurfaceTexels(textured);
  cv::Mat color_bgr(textured.atlas_px, textured.atlas_px, CV_8UC3, cv::Scalar::all(0));
  cv::Mat seen = cv::Mat::zeros(color_bgr.size(), CV_8UC1);
  for (const SurfaceTexel& texel : texels) {
    if (texel.face == 1) continue;
    seen.data[texel.index] = 255;
    reinterpret_cast<cv::Vec3b*>(color_bgr.data)[texel.index] = cv::Vec3b(200, 200, 200);
  }
  FillUnseen(textured, texels, seen, color_bgr);
  for (const SurfaceTexel& texel : texels) {
    const cv::Vec3b expected = texel.face == 1 ? cv::Vec3b(90, 60, 30) : cv::Vec3b(200, 200, 200);
    ASSERT_EQ(reinterpret_cast<const cv::Vec3b*>(color_bgr.data)[texel.index], expected);
  }
}

}  // namespace romap::texture::fill_unseen_test
