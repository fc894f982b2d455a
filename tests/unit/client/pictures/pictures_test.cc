#include "client/pictures/pictures.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace romap::pictures::pictures_test {

CameraModel SmallCamera() {
  return {.width_px = 320, .height_px = 240, .fx_px = 300, .fy_px = 300, .cx_px = 159.5, .cy_px = 119.5};
}

ObjectUpdate ObjectAt(uint64_t id, const Eigen::Vector3d& center, const Eigen::Vector3d& half_extents) {
  ObjectUpdate object;
  object.id = ObjectId{id};
  object.state = ObjectState::kConfirmed;
  object.class_name = "cup";
  object.cuboid.T_world_object = {Eigen::Quaterniond::Identity(), center};
  object.cuboid.half_extents = half_extents;
  return object;
}

cv::Mat Black() { return cv::Mat::zeros(240, 320, CV_8UC3); }

bool HasColor(const cv::Mat& image_bgr, const cv::Scalar& color) {
  cv::Mat match;
  cv::inRange(image_bgr, color, color, match);
  return cv::countNonZero(match) > 0;
}

bool Painted(const cv::Mat& image_bgr, int u, int v) {
  const cv::Rect around = cv::Rect(u - 1, v - 1, 3, 3) & cv::Rect(0, 0, image_bgr.cols, image_bgr.rows);
  return cv::norm(image_bgr(around)) > 0;
}

Mesh Cube(const Eigen::Vector3f& center, float half, const Rgb8& color) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.push_back(
        center + half * Eigen::Vector3f((i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 4) != 0 ? 1 : -1));
  }
  mesh.colors.assign(8, color);
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

TEST(DrawCuboidsTest, DrawsProjectedEdges) {
  cv::Mat image = Black();
  const std::array objects = {ObjectAt(3, {0, 0, 4}, {0.5, 0.4, 1})};
  DrawCuboids(image, SmallCamera(), {}, objects);
  // Front face at z = 3: x = 159.5 +- 50, y = 119.5 +- 40. Back face at z = 5: +- 30, +- 24.
  EXPECT_TRUE(Painted(image, 210, 130));
  EXPECT_TRUE(Painted(image, 170, 160));
  EXPECT_TRUE(Painted(image, 190, 125));
  EXPECT_FALSE(Painted(image, 160, 120)) << "wireframe only";
  EXPECT_FALSE(Painted(image, 240, 120));
  EXPECT_TRUE(HasColor(image, ObjectColorBgr(ObjectId{3})));
}

TEST(DrawCuboidsTest, DrawsNothingBehindTheCamera) {
  cv::Mat image = Black();
  const std::array objects = {ObjectAt(1, {0, 0, -4}, {0.5, 0.4, 1})};
  DrawCuboids(image, SmallCamera(), {}, objects);
  EXPECT_EQ(cv::norm(image), 0);
}

TEST(DrawCuboidsTest, ClipsEdgesThatExtendBehindTheCamera) {
  // The camera is inside: only the far face is visible, and edges leave the image without crossing its center.
  cv::Mat image = Black();
  const std::array objects = {ObjectAt(1, {0, 0, 0}, {1, 0.8, 4})};
  DrawCuboids(image, SmallCamera(), {}, objects);
  EXPECT_TRUE(Painted(image, 159 + 75, 120)) << "far face at z = 4";
  EXPECT_TRUE(Painted(image, 159 + 113, 119 + 90)) << "edge along z, at z = 2.67";
  EXPECT_FALSE(Painted(image, 160, 120));
}

TEST(DrawCuboidsTest, SkipsLostObjects) {
  cv::Mat image = Black();
  std::array objects = {ObjectAt(1, {0, 0, 4}, {0.5, 0.4, 1})};
  objects[0].state = ObjectState::kLost;
  DrawCuboids(image, SmallCamera(), {}, objects);
  EXPECT_EQ(cv::norm(image), 0);
}

TEST(DrawCuboidsTest, KeepsLabelsInsideTheImage) {
  cv::Mat image = Black();
  // The top of this cuboid is far above the image.
  const std::array objects = {ObjectAt(2, {0, 0, 4}, {0.2, 5, 0.5})};
  DrawCuboids(image, SmallCamera(), {}, objects);
  // The filled label is at the top of the image.
  cv::Mat match;
  cv::inRange(image.rowRange(0, 16), ObjectColorBgr(ObjectId{2}), ObjectColorBgr(ObjectId{2}), match);
  EXPECT_GT(cv::countNonZero(match), 100);
}

TEST(ObjectColorBgrTest, DiffersBetweenConsecutiveIds) {
  for (uint64_t a = 1; a <= 8; ++a) {
    for (uint64_t b = a + 1; b <= 8; ++b) {
      const cv::Scalar difference = ObjectColorBgr(ObjectId{a}) - ObjectColorBgr(ObjectId{b});
      EXPECT_GT(std::abs(difference[0]) + std::abs(difference[1]) + std::abs(difference[2]), 40) << a << " and " << b;
    }
  }
}

TEST(DrawMeshBesideViewTest, ShowsTheSameSquareInThreePanels) {
  const Mesh mesh = Cube({0.4F, -0.2F, 4}, 0.3F, Rgb8{10, 20, 230});
  // An image that is green at the projection of the cube (front face at z = 3.7) and black elsewhere.
  cv::Mat view = Black();
  const CameraModel camera = SmallCamera();
  const Eigen::Vector2d low = camera.Project({0.1, -0.5, 3.7});
  const Eigen::Vector2d high = camera.Project({0.7, 0.1, 3.7});
  cv::rectangle(view, cv::Point(cvRound(low.x()), cvRound(low.y())), cv::Point(cvRound(high.x()), cvRound(high.y())),
                {0, 255, 0}, cv::FILLED);
  const cv::Mat picture = DrawMeshBesideView({&mesh}, view, camera, {}, nullptr, 120);
  ASSERT_EQ(picture.size(), cv::Size(360, 120));
  EXPECT_EQ(picture.at<cv::Vec3b>(60, 60), cv::Vec3b(0, 255, 0));
  const auto shaded = picture.at<cv::Vec3b>(60, 180);
  EXPECT_EQ(shaded[0], shaded[2]);
  EXPECT_LT(shaded[0], 250);
  EXPECT_EQ(picture.at<cv::Vec3b>(60, 300), cv::Vec3b(230, 20, 10));
  // The left border of the object is at the same column in all panels.
  const auto left_of = [&](int panel, auto is_object) {
    for (int u = 0; u < 120; ++u) {
      if (is_object(picture.at<cv::Vec3b>(60, 120 * panel + u))) return u;
    }
    return -1;
  };
  const int photo = left_of(0, [](const cv::Vec3b& p) { return p[1] > 128 && p[0] < 128; });
  const int colored = left_of(2, [](const cv::Vec3b& p) { return p[2] < 128; });
  EXPECT_NEAR(photo, colored, 2);
  EXPECT_GT(photo, 2);
}

TEST(DrawMeshBesideViewTest, AcceptsEmptyMeshesAndObjectsBehindTheCamera) {
  const cv::Mat view(240, 320, CV_8UC3, cv::Scalar(9, 8, 7));
  const Mesh behind = Cube({0, 0, -4}, 0.3F, Rgb8{1, 1, 1});
  for (const Mesh& mesh : {Mesh{}, behind}) {
    const cv::Mat picture = DrawMeshBesideView({&mesh}, view, SmallCamera(), {}, nullptr, 64);
    ASSERT_EQ(picture.size(), cv::Size(192, 64));
    EXPECT_EQ(picture.at<cv::Vec3b>(32, 32), cv::Vec3b(9, 8, 7));
    EXPECT_EQ(picture.at<cv::Vec3b>(32, 96), cv::Vec3b(255, 255, 255));
  }
  const Mesh empty;
  const Cuboid cuboid = ObjectAt(1, {0, 0, 4}, {0.5, 0.5, 0.5}).cuboid;
  const cv::Mat outlined = DrawMeshBesideView({&empty}, view, SmallCamera(), {}, &cuboid, 64);
  EXPECT_GT(cv::norm(outlined.colRange(0, 64), cv::Mat(64, 64, CV_8UC3, cv::Scalar(9, 8, 7))), 1000);
}

TEST(DrawOverviewTest, FitsEverythingIntoTheImage) {
  const std::array meshes = {Cube({10, 0, 0}, 0.5F, Rgb8{0, 0, 255}), Cube({-10, 3, 0}, 0.5F, Rgb8{255, 0, 0})};
  const std::array<render::MeshInstance, 2> instances = {{{&meshes[0]}, {&meshes[1]}}};
  const cv::Mat picture = DrawOverview(instances, {}, Eigen::Vector3d::UnitZ(), {300, 200});
  ASSERT_EQ(picture.size(), cv::Size(300, 200));
  EXPECT_TRUE(HasColor(picture, cv::Scalar(255, 0, 0)));
  EXPECT_TRUE(HasColor(picture, cv::Scalar(0, 0, 255)));
  const cv::Mat white(1, 300, CV_8UC3, cv::Scalar(255, 255, 255));
  EXPECT_EQ(cv::norm(picture.row(0), white), 0) << "nothing is clipped at the top";
  EXPECT_EQ(cv::norm(picture.row(199), white), 0);
}

TEST(DrawOverviewTest, ViewsFromAbove) {
  // The blue cube above the red one appears higher in the image for any up direction.
  for (const Eigen::Vector3d& up : {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, -1, 0), Eigen::Vector3d(0, 0, -1)}) {
    const std::array meshes = {Cube((1.2 * up).cast<float>(), 0.5F, Rgb8{0, 0, 255}),
                               Cube({0, 0, 0}, 0.1F, Rgb8{255, 0, 0})};
    const std::array<render::MeshInstance, 2> instances = {{{&meshes[0]}, {&meshes[1]}}};
    const cv::Mat picture = DrawOverview(instances, {}, up, {300, 200});
    int blue_v = 0, red_v = 0, blue = 0, red = 0;
    for (int v = 0; v < picture.rows; ++v) {
      for (int u = 0; u < picture.cols; ++u) {
        const auto pixel = picture.at<cv::Vec3b>(v, u);
        if (pixel == cv::Vec3b(255, 0, 0)) blue_v += v, ++blue;
        if (pixel == cv::Vec3b(0, 0, 255)) red_v += v, ++red;
      }
    }
    ASSERT_GT(blue, 0);
    ASSERT_GT(red, 0);
    EXPECT_LT(blue_v / blue, red_v / red) << "up = " << up.transpose();
  }
}

TEST(DrawOverviewTest, DrawsTheSamePictureFarFromTheOriginAndInAnyUnit) {
  const Mesh mesh = Cube({0.1F, 0.2F, 0}, 0.5F, Rgb8{0, 0, 255});
  const auto picture = [&](double scale, const Eigen::Vector3d& origin) {
    const render::MeshInstance instance{
        .mesh = &mesh, .S_world_mesh = Sim3<World, Object>(scale, Eigen::Quaterniond::Identity(), origin)};
    ObjectUpdate object = ObjectAt(1, {0, 0, 0}, scale * Eigen::Vector3d(0.7, 0.8, 0.6));
    object.cuboid.T_world_object = SE3<World, Object>(Eigen::Quaterniond::Identity(), origin);
    return DrawOverview(std::span(&instance, 1), std::span(&object, 1), Eigen::Vector3d::UnitZ(), {300, 200});
  };
  const cv::Mat near = picture(1, {0, 0, 0});
  EXPECT_TRUE(HasColor(near, cv::Scalar(255, 0, 0)));
  // Rounding may change single pixels.
  EXPECT_LT(cv::norm(near, picture(1, {500'000, -6'400'000, 100}), cv::NORM_L1) / (300.0 * 200 * 3), 0.2);
  EXPECT_LT(cv::norm(near, picture(1e-3, {0, 0, 0}), cv::NORM_L1) / (300.0 * 200 * 3), 0.2);
  EXPECT_LT(cv::norm(near, picture(1e3, {0, 0, 0}), cv::NORM_L1) / (300.0 * 200 * 3), 0.2);
}

TEST(DrawOverviewTest, AcceptsAnEmptyMap) {
  const cv::Mat picture = DrawOverview({}, {}, Eigen::Vector3d::UnitZ(), {64, 48});
  EXPECT_EQ(picture.at<cv::Vec3b>(24, 32), cv::Vec3b(255, 255, 255));
}

}  // namespace romap::pictures::pictures_test
