#include "client/synth/exposure_blur.h"

#include <cmath>
#include <optional>

#include "client/synth/shading.h"
#include "common/lens.h"
#include "common/parallel_for.h"

namespace romap::synth {
namespace {

// The color of the sharp image at a surface point, interpolated between the pixels that show the same surface. nullopt
// if there are too few.
std::optional<Rgb> ColorAt(const SharpImage& sharp, const Scene& scene, const CameraModel& camera,
                           const Eigen::Vector3d& p_world, uint16_t surface) {
  constexpr float kMinWeight = 0.3F;
  constexpr double kDepthTolerance = 0.02;  // relative
  const Eigen::Vector3d p_camera = sharp.poses.CameraPoint(p_world);
  if (p_camera.z() <= 0) return std::nullopt;
  const Eigen::Vector2d pixel_px = ProjectDistorted(camera, p_camera);
  if (!(pixel_px.x() >= 0 && pixel_px.y() >= 0 && pixel_px.x() < camera.width_px - 1 &&
        pixel_px.y() < camera.height_px - 1)) {
    return std::nullopt;
  }
  const int u = static_cast<int>(pixel_px.x());
  const int v = static_cast<int>(pixel_px.y());
  const auto right = static_cast<float>(pixel_px.x() - u);
  const auto down = static_cast<float>(pixel_px.y() - v);
  Rgb sum = Rgb::Zero();
  float total = 0;
  for (int k = 0; k < 4; ++k) {
    const size_t index = sharp.centers.Index(u + k % 2, v + k / 2);
    const int32_t triangle = sharp.centers.triangle[index];
    if (triangle == render::VisibilityImage::kNothing) continue;
    if (scene.surface_of_triangle[static_cast<size_t>(triangle)] != surface) continue;
    if (std::abs(sharp.centers.inverse_depth_mu[index] * p_camera.z() - 1) > kDepthTolerance) continue;
    const float weight = (k % 2 == 0 ? 1 - right : right) * (k / 2 == 0 ? 1 - down : down);
    sum += weight * sharp.colors[index];
    total += weight;
  }
  if (total < kMinWeight) return std::nullopt;
  return Rgb(sum / total);
}

}  // namespace

ExposureBlur::ExposureBlur(const Scene& scene, const CameraModel& camera, std::shared_ptr<const Bvh> bvh)
    : scene_(scene), camera_(camera) {
  if (camera.HasDistortion()) {
    samplers_.emplace_back(scene, camera, 1, bvh);
    return;
  }
  // Sample positions in a rotated grid prevent stairs along edges in the direction of motion.
  for (const auto& [u, v] : {std::pair{-0.375, -0.125}, {0.125, -0.375}, {0.375, 0.125}, {-0.125, 0.375}}) {
    CameraModel shifted = camera;
    shifted.cx_px -= u;
    shifted.cy_px -= v;
    samplers_.emplace_back(scene, shifted, 1, bvh);
  }
}

void ExposureBlur::AddMoment(const SharpImage& sharp, const ImagePoses& poses, const Visibility& visibility,
                             std::vector<Rgb>& sum) const {
  const render::VisibilityImage image = visibility.Find(poses);
  const auto pixel_rad = static_cast<float>(1 / camera_.fx_px);
  ParallelFor(camera_.height_px, [&](int v) {
    const SE3<World, Camera> T_world_camera = poses.Row(visibility.Row_px(v));
    const Eigen::Matrix3d rotation = T_world_camera.RotationMatrix();
    for (int u = 0; u < camera_.width_px; ++u) {
      const size_t index = image.Index(u, v);
      const int32_t triangle = image.triangle[index];
      if (triangle == render::VisibilityImage::kNothing) {
        sum[index] += scene_.background;
        continue;
      }
      const float inverse_depth = image.inverse_depth_mu[index];
      const Eigen::Vector3d ray_camera = visibility.Ray(u, v);
      const Eigen::Vector3d p_world = rotation * ray_camera / inverse_depth + T_world_camera.translation();
      const std::optional<Rgb> color =
          ColorAt(sharp, scene_, camera_, p_world, scene_.surface_of_triangle[static_cast<size_t>(triangle)]);
      sum[index] += color ? *color : Radiance(scene_, triangle, T_world_camera, ray_camera, inverse_depth, pixel_rad);
    }
  });
}

std::vector<Rgb> ExposureBlur::Average(const SharpImage& sharp, std::span<const ImagePoses> moments) const {
  std::vector<Rgb> colors(sharp.colors.size(), Rgb::Zero());
  for (size_t k = 0; k < moments.size(); ++k) AddMoment(sharp, moments[k], samplers_[k % samplers_.size()], colors);
  for (Rgb& color : colors) color /= static_cast<float>(moments.size());
  return colors;
}

}  // namespace romap::synth
