#include "server/texture/bake_texture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <opencv2/imgproc.hpp>

#include "common/statistics.h"
#include "server/texture/mesh_edges.h"
#include "server/texture/surface_texels.h"
#include "tests/unit/server/texture/rendered_views.h"
#include "tests/unit/server/texture/texture_scenes.h"

namespace romap::texture::bake_texture_test {

TexturedMesh UnwrappedSphere() {
  Mesh sphere = SphereMesh(20);
  SetAngleWeightedNormals(sphere);
  return *UnwrapMesh(sphere, {.texels_per_mu = 100});
}

const TexturedMesh& Sphere() {
  static const TexturedMesh sphere = UnwrappedSphere();
  return sphere;
}

// Views of the sphere; the pixels are copies that a test may change.
std::vector<TrainingCamera> SphereViews() {
  static const std::vector<TrainingCamera> photos = PhotographAll(PosesAround(24, 5, 0), SolidSphere(), Checker());
  std::vector<TrainingCamera> views = photos;
  for (TrainingCamera& view : views) {
    view.color_bgr = view.color_bgr.clone();
    view.ray_kind = view.ray_kind.clone();
  }
  return views;
}

const BakedTexture& CleanTexture() {
  static const BakedTexture texture = BakeTexture(Sphere(), SphereViews(), {});
  return texture;
}

double PsnrOfSphere(const BakedTexture& texture) {
  static const std::vector<TrainingCamera> held_out = PhotographAll(PosesAround(4, 5, 0.31), SolidSphere(), Checker());
  return PsnrOfViews(Sphere().mesh, ColorOfTexture(Sphere(), texture.color_bgr), held_out);
}

// Share of the texels of the surface whose color differs by more than `levels`.
double ShareChanged(const cv::Mat& a, const cv::Mat& b, int levels) {
  size_t changed = 0;
  const std::vector<SurfaceTexel> texels = FindSurfaceTexels(Sphere());
  for (const SurfaceTexel& texel : texels) {
    const auto x = static_cast<int>(texel.index) % a.cols, y = static_cast<int>(texel.index) / a.cols;
    changed += cv::norm(a.at<cv::Vec3b>(y, x), b.at<cv::Vec3b>(y, x), cv::NORM_INF) > levels;
  }
  return static_cast<double>(changed) / static_cast<double>(texels.size());
}

TEST(BakeTextureTest, ViewsAroundTheObjectShowAllOfIt) {
  const BakedTexture& texture = CleanTexture();
  EXPECT_EQ(texture.color_bgr.type(), CV_8UC3);
  EXPECT_EQ(texture.color_bgr.size(), cv::Size(Sphere().atlas_px, Sphere().atlas_px));
  for (const SurfaceTexel& texel : FindSurfaceTexels(Sphere())) {
    ASSERT_EQ(texture.seen.data[texel.index], 255) << texel.position.transpose();
  }
  EXPECT_GE(PsnrOfSphere(texture), 29.5);
}

TEST(BakeTextureTest, AHighlightInOneViewDoesNotChangeTheTexture) {
  for (const size_t changed : {3u, 12u, 20u}) {
    std::vector<TrainingCamera> views = SphereViews();
    cv::circle(views[changed].color_bgr, {100, 100}, 25, cv::Scalar(255, 255, 255), cv::FILLED);
    const BakedTexture texture = BakeTexture(Sphere(), views, {});
    const double share = ShareChanged(texture.color_bgr, CleanTexture().color_bgr, 25);
    EXPECT_LT(share, 0.004);
    EXPECT_GE(PsnrOfSphere(texture), 29);
  }
}

TEST(BakeTextureTest, AnObjectInFrontInOneViewDoesNotChangeTheTexture) {
  std::vector<TrainingCamera> views = SphereViews();
  cv::rectangle(views[12].color_bgr, {20, 80, 160, 30}, cv::Scalar(30, 160, 30), cv::FILLED);
  const BakedTexture texture = BakeTexture(Sphere(), views, {});
  const double share = ShareChanged(texture.color_bgr, CleanTexture().color_bgr, 25);
  EXPECT_LT(share, 0.004);
  EXPECT_GE(PsnrOfSphere(texture), 29);
}

// Pixels that the mask assigns to another object are not used, whatever they show.
TEST(BakeTextureTest, PixelsOutsideTheMaskAreNotUsed) {
  std::vector<TrainingCamera> views = SphereViews();
  for (TrainingCamera& view : views) {
    const cv::Rect box(90, 20, 40, 160);
    cv::rectangle(view.color_bgr, box, cv::Scalar(255, 0, 255), cv::FILLED);
    view.ray_kind(box).setTo(static_cast<int>(RayKind::kOccluder));
  }
  const BakedTexture texture = BakeTexture(Sphere(), views, {});
  for (const SurfaceTexel& texel : FindSurfaceTexels(Sphere())) {
    const auto& color = reinterpret_cast<const cv::Vec3b*>(texture.color_bgr.data)[texel.index];
    ASSERT_FALSE(color[0] > 220 && color[1] < 60) << color;
  }
}

TEST(BakeTextureTest, ExposureDifferencesLeaveNoSeams) {
  constexpr double kDark = 0.85;  // no color is saturated
  std::vector<TrainingCamera> views = SphereViews();
  for (size_t i = 0; i < views.size(); ++i) {
    const double x = static_cast<double>(i);
    const cv::Scalar gain(1 + 0.2 * std::sin(7 * x), 1 + 0.2 * std::sin(7 * x + 0.3), 1 + 0.2 * std::sin(7 * x - 0.3));
    cv::multiply(views[i].color_bgr, kDark * gain, views[i].color_bgr);
  }
  const BakedTexture texture = BakeTexture(Sphere(), views, {});
  // The ratio to the texture from
  // photos with equal exposure: its mean over small regions is the same everywhere.
  cv::Mat ratio, expected;
  texture.color_bgr.convertTo(ratio, CV_32FC3);
  CleanTexture().color_bgr.convertTo(expected, CV_32FC3);
  cv::blur(ratio, ratio, {9, 9});
  cv::blur(expected, expected, {9, 9});
  cv::divide(ratio, expected, ratio);
  std::array<std::vector<double>, 3> ratios;
  for (const SurfaceTexel& texel : FindSurfaceTexels(Sphere())) {
    const auto& value = reinterpret_cast<const cv::Vec3f*>(ratio.data)[texel.index];
    for (int c = 0; c < 3; ++c) ratios[c].push_back(value[c]);
  }
  for (int c = 0; c < 3; ++c) {
    const double low = Quantile(ratios[c], 0.005), high = Quantile(ratios[c], 0.995), median = Median(ratios[c]);
    EXPECT_GT(low / median, 0.98);
    EXPECT_LT(high / median, 1.02);
    EXPECT_NEAR(median, kDark, 0.06);
  }
}

// Both sides of an edge between charts, at the same points.
TEST(BakeTextureTest, BordersOfChartsAreNotVisible) {
  const TexturedMesh& sphere = Sphere();
  const SolidTexture stripes = [](const Eigen::Vector3d& p) {
    return Eigen::Array3d(120 + 80 * std::sin(20 * p.x() + 5 * p.y()), 120 + 80 * std::sin(17 * p.y()),
                          120 + 80 * std::sin(20 * p.z()));
  };
  const BakedTexture texture = BakeTexture(sphere, PhotographAll(PosesAround(24, 5, 0), SolidSphere(), stripes), {});
  std::map<std::array<float, 6>, std::pair<uint32_t, uint32_t>> edges;
  std::vector<double> differences;
  size_t seams = 0;
  for (const auto& triangle : sphere.mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      const uint32_t a = triangle[i], b = triangle[(i + 1) % 3];
      const auto key = [&](uint32_t from, uint32_t to) {
        const Eigen::Vector3f &p = sphere.mesh.vertices[from], &q = sphere.mesh.vertices[to];
        return std::array<float, 6>{p.x(), p.y(), p.z(), q.x(), q.y(), q.z()};
      };
      edges[key(a, b)] = {a, b};
      const auto other = edges.find(key(b, a));
      if (other == edges.end() || (other->second.first == b && other->second.second == a)) continue;
      ++seams;
      for (const double share : {0.0, 0.25, 0.5, 0.75}) {
        const auto at = [&](uint32_t from, uint32_t to) {
          const Eigen::Vector2d uv =
              (1 - share) * sphere.mesh.uv[from].cast<double>() + share * sphere.mesh.uv[to].cast<double>();
          return TextureAt(texture.color_bgr, uv);
        };
        differences.push_back((at(a, b) - at(other->second.second, other->second.first)).abs().maxCoeff());
      }
    }
  }
  EXPECT_GT(seams, 50u);
  EXPECT_LT(Median(differences), 1);
  EXPECT_LT(Quantile(differences, 0.95), 2);
}

TEST(BakeTextureTest, BlurredViewsDoNotBlurTheTexture) {
  std::vector<TrainingCamera> views = SphereViews();
  for (size_t i = 0; i < views.size(); ++i) {
    if (i % 3 != 0) cv::GaussianBlur(views[i].color_bgr, views[i].color_bgr, {0, 0}, 2.5);
  }
  const double psnr = PsnrOfSphere(BakeTexture(Sphere(), views, {}));
  for (TrainingCamera& view : views) cv::GaussianBlur(view.color_bgr, view.color_bgr, {0, 0}, 2.5);
  const double all_blurred = PsnrOfSphere(BakeTexture(Sphere(), views, {}));
  EXPECT_GE(psnr, all_blurred + 4);
}

TEST(BakeTextureTest, HiddenSurfacesAreNotColoredByThoseInFront) {
  // A small blue sphere beside a red one.
  const Eigen::Vector3d center(1.5, 0, 0.2);
  const SolidShape big = SolidSphere();
  const SolidShape both = [&](const Eigen::Vector3d& origin, const Eigen::Vector3d& d) -> std::optional<double> {
    const std::optional<double> of_big = big(origin, d), of_small = big((origin - center) / 0.3, d / 0.3);
    if (of_big.has_value() && of_small.has_value()) return std::min(*of_big, *of_small);
    return of_big.has_value() ? of_big : of_small;
  };
  const SolidTexture color = [&](const Eigen::Vector3d& p) {
    return (p - center).norm() < 0.4 ? Eigen::Array3d(250, 40, 40) : Eigen::Array3d(40, 40, 200);
  };
  Mesh mesh = SphereMesh(20);
  const auto first = static_cast<uint32_t>(mesh.vertices.size());
  const Mesh small = SphereMesh(8, 0.3);
  for (const Eigen::Vector3f& p : small.vertices) mesh.vertices.push_back(p + center.cast<float>());
  for (const auto& [a, b, c] : small.triangles) mesh.triangles.push_back({first + a, first + b, first + c});
  SetAngleWeightedNormals(mesh);
  const TexturedMesh textured = *UnwrapMesh(mesh, {.texels_per_mu = 80});
  const std::vector<TrainingCamera> views = PhotographAll(PosesAround(24, 5, 0), both, color);
  const BakedTexture texture = BakeTexture(textured, views, {});
  size_t seen = 0, wrong = 0;
  for (const SurfaceTexel& texel : FindSurfaceTexels(textured)) {
    if (texture.seen.data[texel.index] == 0) continue;
    ++seen;
    const auto& c = reinterpret_cast<const cv::Vec3b*>(texture.color_bgr.data)[texel.index];
    const Eigen::Array3d truth = color(texel.position.cast<double>());
    wrong += (truth - Eigen::Array3d(c[0], c[1], c[2])).abs().maxCoeff() > 30;
  }
  EXPECT_GT(seen, 50'000u);
  EXPECT_LT(static_cast<double>(wrong) / static_cast<double>(seen), 1e-4);
}

TEST(BakeTextureTest, TheUnseenSideIsFlaggedAndContinuesTheColors) {
  TexturedMesh textured = Sphere();
  const Eigen::Array3d vertex_bgr(60, 120, 140), true_bgr(90, 150, 170);
  for (size_t i = 0; i < textured.mesh.vertices.size(); ++i) textured.mesh.colors.push_back({140, 120, 60});
  std::vector<TrainingCamera> views;
  for (int i = 0; i < 8; ++i) {
    const double angle = i * std::numbers::pi / 4;
    views.push_back(Photograph(LookAtOrigin({2 * std::cos(angle), 2 * std::sin(angle), 4.5}), SolidSphere(),
                               [&](const Eigen::Vector3d&) { return true_bgr; }));
  }
  for (const bool has_colors : {true, false}) {
    if (!has_colors) textured.mesh.colors.clear();
    const BakedTexture texture = BakeTexture(textured, views, {});
    for (const SurfaceTexel& texel : FindSurfaceTexels(textured)) {
      const uint8_t seen = texture.seen.data[texel.index];
      ASSERT_TRUE(texel.position.z() < 0.2f || seen == 255) << texel.position.transpose();
      ASSERT_TRUE(texel.position.z() > -0.6f || seen == 0) << texel.position.transpose();
      const auto& c = reinterpret_cast<const cv::Vec3b*>(texture.color_bgr.data)[texel.index];
      ASSERT_LT((true_bgr - Eigen::Array3d(c[0], c[1], c[2])).abs().maxCoeff(), 4) << texel.position.transpose();
    }
  }
}

TEST(BakeTextureTest, WithoutViewsTheTextureShowsTheVertexColors) {
  TexturedMesh textured = Sphere();
  for (const Eigen::Vector3f& p : textured.mesh.vertices) {
    textured.mesh.colors.push_back({static_cast<uint8_t>(128 + 100 * p.x()), static_cast<uint8_t>(128 + 100 * p.y()),
                                    static_cast<uint8_t>(128 + 100 * p.z())});
  }
  // Views that cannot be used are the same as no views.
  std::vector<TrainingCamera> unusable(6, SphereViews()[0]);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  unusable[0].T_camera_object = SE3<Camera, Object>(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, nan, 0));
  unusable[1].camera.fx_px = nan;
  unusable[2].color_bgr = cv::Mat();
  unusable[3].ray_kind = cv::Mat(10, 10, CV_8UC1);
  unusable[4].T_camera_object =
      SE3<Camera, Object>(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, -5));                          // behind
  unusable[5].T_camera_object = SE3<Camera, Object>(Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero());  // inside
  for (const std::vector<TrainingCamera>& views : {std::vector<TrainingCamera>(), unusable}) {
    const BakedTexture texture = BakeTexture(textured, views, {});
    EXPECT_EQ(cv::countNonZero(texture.seen), 0);
    for (const SurfaceTexel& texel : FindSurfaceTexels(textured)) {
      const auto& c = reinterpret_cast<const cv::Vec3b*>(texture.color_bgr.data)[texel.index];
      ASSERT_NEAR(c[2], 128 + 100 * texel.position.x(), 3);
      ASSERT_NEAR(c[0], 128 + 100 * texel.position.z(), 3);
    }
  }
}

TEST(BakeTextureTest, DegenerateMeshes) {
  const BakedTexture empty = BakeTexture(*UnwrapMesh({}, {}), SphereViews(), {});
  EXPECT_EQ(empty.color_bgr.size(), cv::Size(64, 64));
  EXPECT_EQ(cv::countNonZero(empty.seen), 0);
  Mesh triangle;
  triangle.vertices = {{-0.5f, -0.3f, 0.99f}, {0.5f, -0.3f, 0.99f}, {0, 0.4f, 0.99f}};
  triangle.triangles = {{0, 1, 2}};
  const BakedTexture one = BakeTexture(*UnwrapMesh(triangle, {.max_atlas_px = 64}), SphereViews(), {});
  EXPECT_GT(cv::countNonZero(one.seen), 500);
}

}  // namespace romap::texture::bake_texture_test
