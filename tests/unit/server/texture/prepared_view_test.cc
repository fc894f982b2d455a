#include "server/texture/prepared_view.h"

#include <gtest/gtest.h>

#include "tests/unit/server/texture/rendered_views.h"
#include "tests/unit/server/texture/texture_scenes.h"

namespace romap::texture::prepared_view_test {

// The color is the position: (p + 1) * 100.
const SolidTexture kPositions = [](const Eigen::Vector3d& p) { return (p.array() + 1) * 100; };

TrainingCamera FrontView() { return Photograph(LookAtOrigin({5, 0, 0}), SolidSphere(), kPositions); }

TEST(PreparedViewTest, ColorsAreThoseOfThePoint) {
  const PreparedView view(FrontView(), SphereMesh(24));
  for (const Eigen::Vector3d& direction :
       {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(1, 0.5, 0.3), Eigen::Vector3d(0.7, -0.4, -0.5)}) {
    const Eigen::Vector3d p = direction.normalized();
    const ViewedPoint point = view.Find(p.cast<float>(), p.cast<float>());
    ASSERT_GT(point.weight, 0);
    EXPECT_NEAR(point.resolution, 400 / (5 - p.x()), 0.5);
    const ViewSample sample = view.Sample(point);
    const Eigen::Array3d expected = kPositions(p);
    EXPECT_LT((sample.color_bgr.cast<double>() - expected).abs().maxCoeff(), 1.0) << sample.color_bgr.transpose();
    EXPECT_LT((sample.low_bgr.cast<double>() - expected).abs().maxCoeff(), 5.0) << sample.low_bgr.transpose();
  }
}

TEST(PreparedViewTest, TheWeightDecreasesWithAngleAndDistance) {
  const PreparedView view(FrontView(), SphereMesh(24));
  const auto weight = [&](const Eigen::Vector3f& p) { return view.Find(p, p).weight; };
  const float front = weight({1, 0, 0});
  EXPECT_NEAR(front, 100, 1);
  EXPECT_LT(weight({0.8f, 0.6f, 0}), 0.6f * front);
  EXPECT_LT(weight({0.6f, 0.8f, 0}), 0.3f * front);
  EXPECT_EQ(weight({0.3f, 0.954f, 0}), 0);  // 84 degrees
  EXPECT_EQ(weight({-1, 0, 0}), 0);
  const PreparedView far(Photograph(LookAtOrigin({8, 0, 0}), SolidSphere(), kPositions), SphereMesh(24));
  EXPECT_NEAR(far.Find({1, 0, 0}, {1, 0, 0}).weight, 400 / 7.0, 1);
}

TEST(PreparedViewTest, HiddenPointsHaveNoWeight) {
  Mesh mesh = SphereMesh(24);
  const auto first = static_cast<uint32_t>(mesh.vertices.size());
  for (const float y : {-0.4f, 0.4f}) {
    for (const float z : {-0.4f, 0.4f}) mesh.vertices.emplace_back(2, y, z);
  }
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first + 1, first + 3, first + 2});
  const PreparedView view(FrontView(), mesh);
  EXPECT_EQ(view.Find({1, 0, 0}, {1, 0, 0}).weight, 0);
  EXPECT_GT(view.Find({2, 0, 0}, {1, 0, 0}).weight, 0);
  // Beside the edge of the square, which is at y = 0.4 * 4 / 3 on the sphere's side.
  EXPECT_GT(view.Find({0.714f, 0.7f, 0}, {0.714f, 0.7f, 0}).weight, 0);
}

TEST(PreparedViewTest, OnlyPixelsInsideTheMaskCount) {
  TrainingCamera photo = FrontView();
  photo.ray_kind(cv::Rect(0, 0, 100, 200)).setTo(static_cast<int>(RayKind::kOccluder));
  const PreparedView view(photo, SphereMesh(24));
  // The camera looks along -x, so +y is to the right; 100 px per unit at the front.
  const auto weight = [&](float y) { return view.Find({1, y, 0}, {1, 0, 0}).weight; };
  EXPECT_EQ(weight(-0.2f), 0);
  EXPECT_EQ(weight(0.0f), 0);  // the first pixel inside
  EXPECT_GT(weight(0.03f), 0);
  EXPECT_LT(weight(0.03f), 0.7f * weight(0.2f));
  EXPECT_GT(weight(0.2f), 80);
}

TEST(PreparedViewTest, PointsOutsideTheCropOrBehindTheCameraHaveNoWeight) {
  const PreparedView view(FrontView(), SphereMesh(8));
  EXPECT_EQ(view.Find({1, 3, 0}, {1, 0, 0}).weight, 0);
  EXPECT_EQ(view.Find({6, 0, 0}, {-1, 0, 0}).weight, 0);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(view.Find({1, nan, 0}, {1, 0, 0}).weight, 0);
}

}  // namespace romap::texture::prepared_view_test
