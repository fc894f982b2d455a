#include "client/render/rasterizer.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

namespace romap::render::rasterizer_test {

CameraModel SmallCamera() {
  return {.width_px = 100, .height_px = 80, .fx_px = 90, .fy_px = 90, .cx_px = 49.5, .cy_px = 39.5};
}

using Positions = std::vector<Eigen::Vector3f>;
using Triangles = std::vector<std::array<uint32_t, 3>>;

// World and camera axes coincide. Counter-clockwise seen from the camera, whose y points down.
const Triangles kOne = {{0, 1, 2}};
Positions Facing(float z) { return {{-1, -1, z}, {-1, 3, z}, {3, -1, z}}; }

TEST(RasterizeTest, PlaneHasConstantDepth) {
  const Positions positions = {{-9, -9, 2}, {-9, 9, 2}, {9, 9, 2}, {9, -9, 2}};
  const Triangles triangles = {{0, 1, 2}, {0, 2, 3}};
  const VisibilityImage image = Rasterize(SmallCamera(), {}, {positions, triangles}, {.cull_back_faces = true});
  for (int v = 0; v < 80; ++v) {
    for (int u = 0; u < 100; ++u) ASSERT_FLOAT_EQ(image.Depth(u, v), 2) << u << ", " << v;
  }
}

TEST(RasterizeTest, CoversExactlyThePixelCentersInside) {
  // Projects to the corners (9.5, 9.5), (9.5, 59.5), (59.5, 9.5): no pixel center is on a horizontal or vertical edge.
  const float z = 90;
  const Positions positions = {{-40, -30, z}, {-40, 20, z}, {10, -30, z}};
  const VisibilityImage image = Rasterize(SmallCamera(), {}, {positions, kOne});
  for (int v = 0; v < 80; ++v) {
    for (int u = 0; u < 100; ++u) {
      if (u + v == 69) continue;  // on the slanted edge
      const bool inside = u > 9.5 && v > 9.5 && u + v < 69;
      ASSERT_EQ(image.triangle[image.Index(u, v)] == 0, inside) << u << ", " << v;
    }
  }
}

TEST(RasterizeTest, AdjacentTrianglesLeaveNoGapAndTheNearestWins) {
  // A fan around a point that projects exactly to a pixel center, in front of a far plane.
  Positions positions = {{0.5F, 0.5F, 90}};
  Triangles triangles;
  for (int i = 0; i < 12; ++i) {
    const float angle = 0.5236F * static_cast<float>(i);
    positions.emplace_back(0.5F + 30 * std::cos(angle), 0.5F + 30 * std::sin(angle), 90.0F);
    triangles.push_back({0, static_cast<uint32_t>(i + 1), static_cast<uint32_t>((i + 1) % 12 + 1)});
  }
  const Positions far = Facing(300);
  for (const Eigen::Vector3f& p : far) positions.push_back(p.cwiseProduct(Eigen::Vector3f(400, 400, 1)));
  triangles.push_back({13, 14, 15});
  const VisibilityImage image = Rasterize(SmallCamera(), {}, {positions, triangles});
  for (int v = 0; v < 80; ++v) {
    for (int u = 0; u < 100; ++u) {
      const double radius_px = std::hypot(u - 50, v - 40);
      if (radius_px < 28) {
        ASSERT_NEAR(image.Depth(u, v), 90, 1e-3) << u << ", " << v;
      }
      if (radius_px > 31) {
        ASSERT_NEAR(image.Depth(u, v), 300, 1e-2) << u << ", " << v;
      }
    }
  }
}

TEST(RasterizeTest, CullsBackFacesOnlyIfEnabled) {
  const Positions positions = Facing(2);
  const Triangles reversed = {{0, 2, 1}};
  const VisibilityImage both = Rasterize(SmallCamera(), {}, {positions, reversed});
  const VisibilityImage front = Rasterize(SmallCamera(), {}, {positions, reversed}, {.cull_back_faces = true});
  const VisibilityImage facing = Rasterize(SmallCamera(), {}, {positions, kOne}, {.cull_back_faces = true});
  EXPECT_EQ(both.triangle[both.Index(30, 30)], 0);
  EXPECT_EQ(front.triangle[front.Index(30, 30)], VisibilityImage::kNothing);
  EXPECT_EQ(facing.triangle[facing.Index(30, 30)], 0);
}

TEST(RasterizeTest, DrawsAFloorThatExtendsBehindTheCamera) {
  // The plane y = 1 from far behind to far in front: every pixel below the horizon sees it at z = fy / (v - cy).
  const Positions positions = {{-500, 1, -500}, {500, 1, -500}, {500, 1, 5000}, {-500, 1, 5000}};
  const Triangles triangles = {{0, 1, 2}, {0, 2, 3}};
  const CameraModel camera = SmallCamera();
  const VisibilityImage image = Rasterize(camera, {}, {positions, triangles});
  for (int v = 0; v < 80; ++v) {
    for (int u = 0; u < 100; ++u) {
      if (v < 39.5) {
        ASSERT_EQ(image.Depth(u, v), 0) << u << ", " << v;
      } else {
        ASSERT_NEAR(image.Depth(u, v) * (v - camera.cy_px) / camera.fy_px, 1, 1e-4) << u << ", " << v;
      }
    }
  }
}

TEST(RasterizeTest, IgnoresTrianglesBehindOrTooCloseToTheCamera) {
  const Positions behind = Facing(-2);
  const Positions near = Facing(0.05F);
  for (const Positions& positions : {behind, near}) {
    const VisibilityImage image = Rasterize(SmallCamera(), {}, {positions, kOne}, {.near_mu = 0.1});
    for (const int32_t triangle : image.triangle) ASSERT_EQ(triangle, VisibilityImage::kNothing);
  }
}

TEST(RasterizeTest, DoesNotDrawDegenerateAndNonFiniteTriangles) {
  const Positions positions = {{0, 0, 2}, {1, 0, 2}, {2, 0, 2}, {NAN, 0, 2}, {1e30F, 1e30F, 2}};
  const Triangles triangles = {{0, 1, 2}, {0, 0, 0}, {0, 1, 3}, {0, 1, 4}};
  const VisibilityImage image = Rasterize(SmallCamera(), {}, {positions, triangles});
  ASSERT_EQ(image.triangle.size(), 8000U);
  for (const int32_t triangle : image.triangle) {
    // The last triangle is valid but extremely large.
    ASSERT_TRUE(triangle == VisibilityImage::kNothing || triangle == 3) << triangle;
  }
}

TEST(SupersampledTest, SamplesAreInsideTheirPixel) {
  const CameraModel camera = SmallCamera();
  const CameraModel fine = Supersampled(camera, 2);
  const Eigen::Vector3d p(0.31, -0.17, 1.3);
  const Eigen::Vector2d coarse_px = camera.Project(p);
  const Eigen::Vector2d fine_px = fine.Project(p);
  EXPECT_NEAR((fine_px.x() + 0.5) / 2 - 0.5, coarse_px.x(), 1e-9);
  EXPECT_NEAR((fine_px.y() + 0.5) / 2 - 0.5, coarse_px.y(), 1e-9);
  EXPECT_EQ(fine.width_px, 200);
}

TEST(BarycentricsTest, ArePerspectiveCorrect) {
  const std::array<Eigen::Vector3f, 3> corners = {{{0, 0, 1}, {1, 0, 4}, {0, 1, 2}}};
  const Eigen::Vector3f wanted(0.2F, 0.5F, 0.3F);
  const Eigen::Vector3f point = wanted.x() * corners[0] + wanted.y() * corners[1] + wanted.z() * corners[2];
  const Eigen::Vector3d origin(0.1, -0.2, -3);
  const Eigen::Vector3f weights = Barycentrics(corners, origin, 7 * (point.cast<double>() - origin));
  EXPECT_TRUE(weights.isApprox(wanted, 1e-5F)) << weights.transpose();
}

}  // namespace romap::render::rasterizer_test
