#include "client/synth/visibility.h"

#include <optional>
#include <utility>

#include "client/synth/lens_rays.h"
#include "common/parallel_for.h"

namespace romap::synth {

Visibility::Visibility(const Scene& scene, const CameraModel& camera, int samples_across,
                       std::shared_ptr<const Bvh> bvh)
    : scene_(scene),
      samples_across_(samples_across),
      camera_(render::Supersampled(camera, samples_across)),
      bvh_(std::move(bvh)) {
  if (camera.HasDistortion()) lens_rays_ = LensRays(camera, samples_across);
}

render::VisibilityImage Visibility::Find(const ImagePoses& poses) const {
  return lens_rays_.empty() ? Rasterize(poses) : Trace(poses);
}

Eigen::Vector3d Visibility::Ray(int u_sample, int v_sample) const {
  if (lens_rays_.empty()) return camera_.Unproject(u_sample, v_sample);
  return lens_rays_[static_cast<size_t>(v_sample) * static_cast<size_t>(camera_.width_px) +
                    static_cast<size_t>(u_sample)]
      .homogeneous();
}

double Visibility::Row_px(int v_sample) const { return (v_sample + 0.5) / samples_across_ - 0.5; }

render::VisibilityImage Visibility::Rasterize(const ImagePoses& poses) const {
  constexpr render::RasterOptions kOptions{.cull_back_faces = true};
  if (!poses.Rolling()) return render::Rasterize(camera_, poses.Row(0), scene_.Soup(), kOptions);
  // Each vertex is moved to the camera frame of its own row. Triangles are small, so their edges remain straight.
  std::vector<Eigen::Vector3f> positions_camera(scene_.positions_world.size());
  ParallelForRanges(positions_camera.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      positions_camera[i] = poses.CameraPoint(scene_.positions_world[i].cast<double>()).cast<float>();
    }
  });
  return render::Rasterize(camera_, SE3<World, Camera>(), {positions_camera, scene_.triangles}, kOptions);
}

render::VisibilityImage Visibility::Trace(const ImagePoses& poses) const {
  render::VisibilityImage image;
  image.width_px = camera_.width_px;
  image.height_px = camera_.height_px;
  image.triangle.assign(lens_rays_.size(), render::VisibilityImage::kNothing);
  image.inverse_depth_mu.assign(lens_rays_.size(), 0.0F);
  ParallelFor(camera_.height_px, [&](int v) {
    const SE3<World, Camera> T_world_camera = poses.Row(Row_px(v));
    const Eigen::Vector3f origin_m = T_world_camera.translation().cast<float>();
    const Eigen::Matrix3d rotation = T_world_camera.RotationMatrix();
    for (int u = 0; u < camera_.width_px; ++u) {
      const size_t i = image.Index(u, v);
      const Eigen::Vector3d direction = rotation * lens_rays_[i].homogeneous();
      const std::optional<Bvh::Hit> hit = bvh_->Nearest(origin_m, direction.cast<float>());
      if (!hit) continue;
      image.triangle[i] = static_cast<int32_t>(hit->triangle);
      image.inverse_depth_mu[i] = 1 / hit->t;  // the ray has z = 1 in the camera frame
    }
  });
  return image;
}

}  // namespace romap::synth
