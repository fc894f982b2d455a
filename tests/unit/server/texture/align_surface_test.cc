#include "server/texture/align_surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/unit/server/texture/rendered_views.h"
#include "tests/unit/server/texture/texture_scenes.h"

namespace romap::texture::align_surface_test {

constexpr double kDistance_mu = 5;
constexpr float kPixel_mu = 5.0F / 400;  // at the center of the object

std::vector<TrainingCamera> Photos(const SolidTexture& color, int count = 16) {
  std::vector<TrainingCamera> views;
  for (const auto& pose : PosesAround(count, kDistance_mu, 0.1)) {
    views.push_back(Photograph(pose, SolidSphere(), color));
  }
  return views;
}

Mesh Ball(double radius_mu) {
  Mesh mesh = SphereMesh(40, radius_mu);
  for (const Eigen::Vector3f& p : mesh.vertices) mesh.normals.push_back(p.normalized());
  return mesh;
}

// Mean distance from the true surface, in pixels of the views, of the part that most views show well.
float MeanError_px(const Mesh& mesh) {
  float sum = 0;
  int count = 0;
  for (const Eigen::Vector3f& p : mesh.vertices) {
    if (std::abs(p.z()) > 0.6F) continue;
    sum += std::abs(p.norm() - 1);
    ++count;
  }
  return sum / static_cast<float>(count) / kPixel_mu;
}

TEST(AlignSurfaceTest, ATexturedSurfaceMovesToItsPlace) {
  const std::vector<TrainingCamera> views = Photos(Checker());
  for (const float offset_px : {-1.5F, 1.5F}) {
    Mesh mesh = Ball(1 + offset_px * kPixel_mu);
    const SurfaceAlignment alignment = AlignSurface(views, mesh);
    EXPECT_LT(MeanError_px(mesh), 0.5F) << offset_px;
    EXPECT_GT(alignment.moved_share, 0.5) << offset_px;
    EXPECT_LT(alignment.mean_mu * offset_px, 0) << offset_px;
  }
}

TEST(AlignSurfaceTest, ASurfaceInItsPlaceStays) {
  Mesh mesh = Ball(1);
  AlignSurface(Photos(Checker()), mesh);
  EXPECT_LT(MeanError_px(mesh), 0.25F);
}

TEST(AlignSurfaceTest, WithoutTextureNothingMoves) {
  const SolidTexture gray = [](const Eigen::Vector3d&) { return Eigen::Array3d(120, 120, 120); };
  Mesh mesh = Ball(1 + 1.5 * kPixel_mu);
  const SurfaceAlignment alignment = AlignSurface(Photos(gray), mesh);
  EXPECT_NEAR(MeanError_px(mesh), 1.5F, 0.1F);
  EXPECT_LT(alignment.moved_share, 0.01);
}

// Stripes that repeat about every four pixels: several distances agree, so none is chosen against the present one.
TEST(AlignSurfaceTest, ARepeatedTextureIsNoEvidence) {
  const SolidTexture stripes = [](const Eigen::Vector3d& p) {
    const double value = 128 + 60 * std::sin(2 * M_PI * (p.x() + p.y() + p.z()) / (4 * static_cast<double>(kPixel_mu)));
    return Eigen::Array3d(value, value, value);
  };
  const std::vector<TrainingCamera> views = Photos(stripes);
  Mesh mesh = Ball(1);
  AlignSurface(views, mesh);
  EXPECT_LT(MeanError_px(mesh), 0.4F);
}

TEST(AlignSurfaceTest, TwoViewsAreNoEvidence) {
  Mesh mesh = Ball(1.01);
  const Mesh before = mesh;
  AlignSurface(Photos(Checker(), 2), mesh);
  EXPECT_EQ(mesh.vertices, before.vertices);
}

}  // namespace romap::texture::align_surface_test
