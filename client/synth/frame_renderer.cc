#include "client/synth/frame_renderer.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "client/synth/shading.h"
#include "common/parallel_for.h"

namespace romap::synth {
namespace {

bool ShareVertex(const std::array<uint32_t, 3>& a, const std::array<uint32_t, 3>& b) {
  return std::any_of(a.begin(), a.end(), [&](uint32_t i) { return i == b[0] || i == b[1] || i == b[2]; });
}

std::shared_ptr<const Bvh> BvhForLens(const Scene& scene, const CameraModel& camera) {
  if (!camera.HasDistortion()) return nullptr;
  return std::make_shared<const Bvh>(scene.positions_world, scene.triangles);
}

}  // namespace

FrameRenderer::FrameRenderer(const Scene& scene, const CameraModel& camera)
    : FrameRenderer(scene, camera, BvhForLens(scene, camera)) {}

FrameRenderer::FrameRenderer(const Scene& scene, const CameraModel& camera, const std::shared_ptr<const Bvh>& bvh)
    : scene_(scene),
      camera_(camera),
      pixel_rad_(static_cast<float>(1 / std::sqrt(camera.fx_px * camera.fy_px))),
      centers_(scene, camera, 1, bvh),
      fine_(scene, camera, kSamplesAcross, bvh),
      blur_(scene, camera, bvh) {}

// Whether all samples of a pixel hit the same smooth surface, so that one color evaluation suffices.
bool FrameRenderer::SameSurface(const std::array<int32_t, kSamples>& hits) const {
  if (hits[0] == render::VisibilityImage::kNothing) return false;
  for (const int32_t hit : hits) {
    if (hit == hits[0]) continue;
    if (hit == render::VisibilityImage::kNothing) return false;
    const auto a = static_cast<size_t>(hits[0]);
    const auto b = static_cast<size_t>(hit);
    if (scene_.surface_of_triangle[a] != scene_.surface_of_triangle[b]) return false;
    // Adjacent triangles of a smooth surface share a vertex; triangles at an occlusion within a surface do not.
    if (!ShareVertex(scene_.triangles[a], scene_.triangles[b])) return false;
  }
  return true;
}

Rgb FrameRenderer::CenterColor(const render::VisibilityImage& centers, const ImagePoses& poses, int u_px,
                               int v_px) const {
  const size_t index = centers.Index(u_px, v_px);
  const int32_t triangle = centers.triangle[index];
  if (triangle == render::VisibilityImage::kNothing) return scene_.background;
  return Radiance(scene_, triangle, poses.Row(v_px), centers_.Ray(u_px, v_px), centers.inverse_depth_mu[index],
                  pixel_rad_);
}

Rgb FrameRenderer::MeanColor(const render::VisibilityImage& fine, const ImagePoses& poses, int u_px, int v_px) const {
  std::array<int32_t, kSamples> hits;
  std::array<float, kSamples> inverse_depths;
  for (int k = 0; k < kSamples; ++k) {
    const size_t index =
        fine.Index(u_px * kSamplesAcross + k % kSamplesAcross, v_px * kSamplesAcross + k / kSamplesAcross);
    hits[k] = fine.triangle[index];
    inverse_depths[k] = fine.inverse_depth_mu[index];
  }
  if (SameSurface(hits)) {
    const Eigen::Vector3d center = centers_.Ray(u_px, v_px);
    if (center.allFinite()) return Radiance(scene_, hits[0], poses.Row(v_px), center, inverse_depths[0], pixel_rad_);
  }
  Rgb sum = Rgb::Zero();
  for (int k = 0; k < kSamples; ++k) {
    if (hits[k] == render::VisibilityImage::kNothing) {
      sum += scene_.background;
      continue;
    }
    const int v_sample = v_px * kSamplesAcross + k / kSamplesAcross;
    const Eigen::Vector3d ray = fine_.Ray(u_px * kSamplesAcross + k % kSamplesAcross, v_sample);
    sum += Radiance(scene_, hits[k], poses.Row(fine_.Row_px(v_sample)), ray, inverse_depths[k],
                    pixel_rad_ / kSamplesAcross);
  }
  return sum / kSamples;
}

std::vector<Rgb> FrameRenderer::SharpColors(const ImagePoses& poses) const {
  const render::VisibilityImage fine = fine_.Find(poses);
  const auto width = static_cast<size_t>(camera_.width_px);
  std::vector<Rgb> colors(width * static_cast<size_t>(camera_.height_px));
  ParallelFor(camera_.height_px, [&](int v) {
    for (int u = 0; u < camera_.width_px; ++u) {
      colors[static_cast<size_t>(v) * width + static_cast<size_t>(u)] = MeanColor(fine, poses, u, v);
    }
  });
  return colors;
}

// One sample per pixel and moment is sufficient, because the moments have different sample positions.
std::vector<Rgb> FrameRenderer::ExposedColors(const render::VisibilityImage& centers, const ImagePoses& poses,
                                              std::span<const ImagePoses> exposure) const {
  std::vector<Rgb> colors(centers.triangle.size());
  ParallelFor(camera_.height_px, [&](int v) {
    for (int u = 0; u < camera_.width_px; ++u) colors[centers.Index(u, v)] = CenterColor(centers, poses, u, v);
  });
  return blur_.Average({poses, centers, colors}, exposure);
}

TrueFrame FrameRenderer::Render(const ImagePoses& poses, std::span<const ImagePoses> exposure) const {
  const render::VisibilityImage centers = centers_.Find(poses);
  const std::vector<Rgb> colors = exposure.empty() ? SharpColors(poses) : ExposedColors(centers, poses, exposure);

  TrueFrame frame;
  frame.color_bgr.create(camera_.height_px, camera_.width_px, CV_8UC3);
  frame.labels.create(camera_.height_px, camera_.width_px, CV_8UC1);
  frame.depth_m.create(camera_.height_px, camera_.width_px, CV_32FC1);
  for (int v = 0; v < camera_.height_px; ++v) {
    for (int u = 0; u < camera_.width_px; ++u) {
      const size_t index = centers.Index(u, v);
      const int32_t triangle = centers.triangle[index];
      frame.depth_m.at<float>(v, u) = centers.Depth(u, v);
      frame.labels.at<uint8_t>(v, u) =
          triangle == render::VisibilityImage::kNothing
              ? uint8_t{0}
              : scene_.surfaces[scene_.surface_of_triangle[static_cast<size_t>(triangle)]].label;
      const Rgb& color = colors[index];
      frame.color_bgr.at<cv::Vec3b>(v, u) = {ToSrgb8(color.z()), ToSrgb8(color.y()), ToSrgb8(color.x())};
    }
  }
  return frame;
}

}  // namespace romap::synth
