#include "client/synth/frame_renderer.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "client/synth/lens_rays.h"

namespace romap::synth {
namespace {

constexpr int kSamplesAcross = 2;
constexpr int kSamples = kSamplesAcross * kSamplesAcross;

// Converts linear intensity 0..1 to an 8-bit sRGB value (IEC 61966-2-1).
uint8_t ToSrgb8(float linear) {
  static const std::array<uint8_t, 4096> kTable = [] {
    std::array<uint8_t, 4096> table;
    for (size_t i = 0; i < table.size(); ++i) {
      const double x = static_cast<double>(i) / static_cast<double>(table.size() - 1);
      const double y = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
      table[i] = static_cast<uint8_t>(std::lround(255 * y));
    }
    return table;
  }();
  return kTable[static_cast<size_t>(std::clamp(linear, 0.0F, 1.0F) * 4095 + 0.5F)];
}

bool ShareVertex(const std::array<uint32_t, 3>& a, const std::array<uint32_t, 3>& b) {
  return std::any_of(a.begin(), a.end(), [&](uint32_t i) { return i == b[0] || i == b[1] || i == b[2]; });
}

// Whether all samples of a pixel hit the same smooth surface, so that one color evaluation suffices.
bool SameSurface(const Scene& scene, const std::array<int32_t, kSamples>& hits) {
  if (hits[0] == render::VisibilityImage::kNothing) return false;
  for (const int32_t hit : hits) {
    if (hit == hits[0]) continue;
    if (hit == render::VisibilityImage::kNothing) return false;
    const auto a = static_cast<size_t>(hits[0]);
    const auto b = static_cast<size_t>(hit);
    if (scene.surface_of_triangle[a] != scene.surface_of_triangle[b]) return false;
    // Adjacent triangles of a smooth surface share a vertex; triangles at an occlusion within a surface do not.
    if (!ShareVertex(scene.triangles[a], scene.triangles[b])) return false;
  }
  return true;
}

Eigen::Vector3d RayThrough(const CameraModel& camera, const std::vector<Eigen::Vector2d>& lens_rays, int u_px,
                           int v_px) {
  if (lens_rays.empty()) return camera.Unproject(u_px, v_px);
  return lens_rays[static_cast<size_t>(v_px) * static_cast<size_t>(camera.width_px) + static_cast<size_t>(u_px)]
      .homogeneous();
}

}  // namespace

FrameRenderer::FrameRenderer(const Scene& scene, const CameraModel& camera)
    : scene_(scene), camera_(camera), fine_camera_(render::Supersampled(camera, kSamplesAcross)) {
  if (!camera.HasDistortion()) return;
  bvh_ = std::make_unique<Bvh>(scene.positions_world, scene.triangles);
  center_rays_ = LensRays(camera, 1);
  fine_rays_ = LensRays(camera, kSamplesAcross);
}

render::VisibilityImage FrameRenderer::Visibility(const CameraModel& camera,
                                                  const std::vector<Eigen::Vector2d>& lens_rays,
                                                  const SE3<World, Camera>& T_world_camera) const {
  if (!bvh_) return render::Rasterize(camera, T_world_camera, scene_.Soup(), {.cull_back_faces = true});
  render::VisibilityImage image;
  image.width_px = camera.width_px;
  image.height_px = camera.height_px;
  image.triangle.assign(lens_rays.size(), render::VisibilityImage::kNothing);
  image.inverse_depth_mu.assign(lens_rays.size(), 0.0F);
  const Eigen::Vector3f origin_m = T_world_camera.translation().cast<float>();
  const Eigen::Matrix3d rotation = T_world_camera.RotationMatrix();
  tbb::parallel_for(tbb::blocked_range<size_t>(0, lens_rays.size(), 1024), [&](const auto& range) {
    for (size_t i = range.begin(); i < range.end(); ++i) {
      const Eigen::Vector3d direction = rotation * lens_rays[i].homogeneous();
      const std::optional<Bvh::Hit> hit = bvh_->Nearest(origin_m, direction.cast<float>());
      if (!hit) continue;
      image.triangle[i] = static_cast<int32_t>(hit->triangle);
      image.inverse_depth_mu[i] = 1 / hit->t;  // the ray has z = 1 in the camera frame
    }
  });
  return image;
}

// Radiance at the intersection of the ray with the triangle, filtered for an area with a side of `pixel_share` pixels.
Rgb FrameRenderer::Radiance(int32_t triangle, const Eigen::Vector3d& ray_camera,
                            const SE3<World, Camera>& T_world_camera, float inverse_depth, float pixel_share) const {
  const std::array<uint32_t, 3>& corner = scene_.triangles[static_cast<size_t>(triangle)];
  const std::array<Eigen::Vector3f, 3> world = {scene_.positions_world[corner[0]], scene_.positions_world[corner[1]],
                                                scene_.positions_world[corner[2]]};
  const Eigen::Vector3d ray = T_world_camera.rotation() * ray_camera;
  // The pixel center may be outside the triangle that a sample hit.
  Eigen::Vector3f weights = render::Barycentrics(world, T_world_camera.translation(), ray).cwiseMax(0.0F);
  weights /= weights.sum();
  const auto blend = [&](const auto& attribute) -> Eigen::Vector3f {
    return weights.x() * attribute[corner[0]] + weights.y() * attribute[corner[1]] + weights.z() * attribute[corner[2]];
  };
  const Eigen::Vector3f normal_world = (world[1] - world[0]).cross(world[2] - world[0]).normalized();
  const auto& local = scene_.positions_local;
  const Eigen::Vector3f normal_local =
      (local[corner[1]] - local[corner[0]]).cross(local[corner[2]] - local[corner[0]]).normalized();
  // On a slanted surface the footprint of a pixel is longer in one direction; use the geometric mean of both.
  const float cosine = std::abs(normal_world.dot(ray.cast<float>().normalized()));
  const float footprint_m =
      pixel_share / (inverse_depth * static_cast<float>(camera_.fx_px) * std::sqrt(std::max(cosine, 0.05F)));
  const Material& material = scene_.surfaces[scene_.surface_of_triangle[static_cast<size_t>(triangle)]].material;
  return Albedo(material, blend(local), normal_local, footprint_m).cwiseProduct(blend(scene_.irradiance));
}

// Mean color of the samples of pixel (u, v).
Rgb FrameRenderer::PixelColor(const render::VisibilityImage& fine, const SE3<World, Camera>& T_world_camera, int u_px,
                              int v_px) const {
  std::array<int32_t, kSamples> hits;
  std::array<float, kSamples> inverse_depths;
  for (int k = 0; k < kSamples; ++k) {
    const size_t index =
        fine.Index(u_px * kSamplesAcross + k % kSamplesAcross, v_px * kSamplesAcross + k / kSamplesAcross);
    hits[k] = fine.triangle[index];
    inverse_depths[k] = fine.inverse_depth_mu[index];
  }
  if (SameSurface(scene_, hits)) {
    const Eigen::Vector3d center = RayThrough(camera_, center_rays_, u_px, v_px);
    if (center.allFinite()) return Radiance(hits[0], center, T_world_camera, inverse_depths[0], 1);
  }
  Rgb sum = Rgb::Zero();
  for (int k = 0; k < kSamples; ++k) {
    if (hits[k] == render::VisibilityImage::kNothing) {
      sum += scene_.background;
      continue;
    }
    const Eigen::Vector3d ray = RayThrough(fine_camera_, fine_rays_, u_px * kSamplesAcross + k % kSamplesAcross,
                                           v_px * kSamplesAcross + k / kSamplesAcross);
    sum += Radiance(hits[k], ray, T_world_camera, inverse_depths[k], 1.0F / kSamplesAcross);
  }
  return sum / kSamples;
}

TrueFrame FrameRenderer::Render(const SE3<World, Camera>& T_world_camera) const {
  const render::VisibilityImage centers = Visibility(camera_, center_rays_, T_world_camera);
  const render::VisibilityImage fine = Visibility(fine_camera_, fine_rays_, T_world_camera);
  TrueFrame frame;
  frame.color_bgr.create(camera_.height_px, camera_.width_px, CV_8UC3);
  frame.labels.create(camera_.height_px, camera_.width_px, CV_8UC1);
  frame.depth_m.create(camera_.height_px, camera_.width_px, CV_32FC1);
  tbb::parallel_for(0, camera_.height_px, [&](int v) {
    for (int u = 0; u < camera_.width_px; ++u) {
      const int32_t triangle = centers.triangle[centers.Index(u, v)];
      frame.depth_m.at<float>(v, u) = centers.Depth(u, v);
      frame.labels.at<uint8_t>(v, u) =
          triangle == render::VisibilityImage::kNothing
              ? uint8_t{0}
              : scene_.surfaces[scene_.surface_of_triangle[static_cast<size_t>(triangle)]].label;
      const Rgb color = PixelColor(fine, T_world_camera, u, v);
      frame.color_bgr.at<cv::Vec3b>(v, u) = {ToSrgb8(color.z()), ToSrgb8(color.y()), ToSrgb8(color.x())};
    }
  });
  return frame;
}

}  // namespace romap::synth
