#include "client/render/mesh_view.h"

#include <gtest/gtest.h>

#include <array>
#include <opencv2/core.hpp>
#include <opencv2/core/mat.hpp>
#include <optional>

namespace romap::render::mesh_view_test {

CameraModel SmallCamera() {
  return {.width_px = 64, .height_px = 64, .fx_px = 64, .fy_px = 64, .cx_px = 31.5, .cy_px = 31.5};
}

// A square centered on the optical axis and perpendicular to it.
Mesh Square(float half, float z, std::optional<Rgb8> color) {
  Mesh mesh;
  mesh.vertices = {{-half, -half, z}, {-half, half, z}, {half, half, z}, {half, -half, z}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  if (color) mesh.colors.assign(4, *color);
  return mesh;
}

TEST(RenderMeshesTest, RendersColorDepthAndIdOfTheNearestMesh) {
  const Mesh near = Square(0.25F, 2, Rgb8{200, 10, 30});
  const Mesh far = Square(0.5F, 3, Rgb8{0, 0, 250});
  const std::array<MeshInstance, 2> instances = {{{&near, 7}, {&far, 9}}};
  const RenderedView view = RenderMeshes(instances, SmallCamera(), {}, MeshPaint::kColored, cv::Scalar(1, 2, 3));
  EXPECT_EQ(view.color_bgr.at<cv::Vec3b>(32, 32), cv::Vec3b(30, 10, 200));
  EXPECT_FLOAT_EQ(view.depth_mu.at<float>(32, 32), 2);
  EXPECT_EQ(view.ids.at<uint16_t>(32, 32), 7);
  // The near square extends 8 pixels from the axis, the far one 10.7.
  EXPECT_EQ(view.color_bgr.at<cv::Vec3b>(32, 41), cv::Vec3b(250, 0, 0));
  EXPECT_EQ(view.ids.at<uint16_t>(32, 41), 9);
  EXPECT_EQ(view.color_bgr.at<cv::Vec3b>(2, 2), cv::Vec3b(1, 2, 3));
  EXPECT_EQ(view.depth_mu.at<float>(2, 2), 0);
  EXPECT_EQ(view.ids.at<uint16_t>(2, 2), 0);
}

// The left half of the texture is red, the right half is green.
TEST(RenderMeshesTest, DrawsTheTextureInsteadOfTheColors) {
  Mesh square = Square(0.25F, 2, Rgb8{1, 2, 3});
  square.uv = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
  cv::Mat texture(8, 8, CV_8UC3, cv::Scalar(0, 0, 255));
  texture(cv::Rect(4, 0, 4, 8)).setTo(cv::Scalar(0, 255, 0));
  const std::array<MeshInstance, 1> instances = {{{.mesh = &square, .id = 1, .texture_bgr = texture}}};
  const RenderedView view = RenderMeshes(instances, SmallCamera(), {}, MeshPaint::kColored);
  EXPECT_EQ(view.color_bgr.at<cv::Vec3b>(32, 26), cv::Vec3b(0, 0, 255));
  EXPECT_EQ(view.color_bgr.at<cv::Vec3b>(32, 37), cv::Vec3b(0, 255, 0));
}

TEST(RenderMeshesTest, ShadesByNormalAndIgnoresColors) {
  // A roof whose ridge points toward the camera; the light comes from the upper left.
  Mesh roof;
  roof.vertices = {{0, -1, 2}, {0, 1, 2}, {-1, 1, 3}, {-1, -1, 3}, {1, -1, 3}, {1, 1, 3}};
  roof.triangles = {{0, 3, 2}, {0, 2, 1}, {0, 1, 5}, {0, 5, 4}};
  roof.colors.assign(6, Rgb8{255, 0, 0});
  const std::array<MeshInstance, 1> instances = {{{&roof, 1}}};
  const RenderedView view = RenderMeshes(instances, SmallCamera(), {}, MeshPaint::kShaded);
  const auto left = view.color_bgr.at<cv::Vec3b>(32, 24);
  const auto right = view.color_bgr.at<cv::Vec3b>(32, 40);
  EXPECT_EQ(left[0], left[2]) << "gray";
  EXPECT_GT(left[0], right[0] + 20);
}

TEST(RenderMeshesTest, FallsBackToShadingWithoutColors) {
  const Mesh plain = Square(0.25F, 2, std::nullopt);
  const std::array<MeshInstance, 1> instances = {{{&plain, 1}}};
  const RenderedView view = RenderMeshes(instances, SmallCamera(), {}, MeshPaint::kColored);
  const auto pixel = view.color_bgr.at<cv::Vec3b>(32, 32);
  EXPECT_EQ(pixel[0], pixel[1]);
  EXPECT_LT(pixel[0], 255);
  EXPECT_GT(pixel[0], 60);
}

TEST(RenderMeshesTest, AcceptsEmptyMeshesAndSkipsInvalidTriangles) {
  const Mesh empty;
  Mesh broken = Square(0.25F, 2, Rgb8{9, 9, 9});
  broken.triangles.push_back({0, 1, 1000});
  const std::array<MeshInstance, 2> instances = {{{&empty, 1}, {&broken, 2}}};
  const RenderedView view = RenderMeshes(instances, SmallCamera(), {}, MeshPaint::kColored);
  EXPECT_EQ(view.ids.at<uint16_t>(32, 32), 2);
  const RenderedView nothing = RenderMeshes({}, SmallCamera(), {}, MeshPaint::kColored, cv::Scalar(5, 5, 5));
  EXPECT_EQ(cv::countNonZero(nothing.ids), 0);
  EXPECT_EQ(nothing.color_bgr.at<cv::Vec3b>(0, 0), cv::Vec3b(5, 5, 5));
}

}  // namespace romap::render::mesh_view_test
