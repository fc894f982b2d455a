#include "server/nerf/ray_set.h"

#include "server/nerf/math/random.h"

namespace romap::nerf {

void RaySet::Build(std::span<const ObjectView> views, const TrainingBox& box, const InputQuality& quality) {
  sampler_.Build(views, quality);
  SetCameras(views, box);
}

void RaySet::SetCameras(std::span<const ObjectView> views, const TrainingBox& box) {
  cameras_.clear();
  unit_mu_ = static_cast<float>(box.unit_mu);
  const SE3<Object, World> T_object_world = box.T_world_object.Inverse();
  for (const ObjectView& view : views) {
    const SE3<Object, Camera> T_object_camera = T_object_world * view.T_world_camera;
    cameras_.push_back({box.ToUnit(T_object_camera.translation()).cast<float>(),
                        T_object_camera.RotationMatrix().cast<float>(), static_cast<float>(view.camera.fx_px),
                        static_cast<float>(view.camera.fy_px), static_cast<float>(view.camera.cx_px),
                        static_cast<float>(view.camera.cy_px)});
  }
}

Ray RaySet::Through(const TrainingPixel& pixel, bool is_object, float jitter) const {
  const ViewCamera& camera = cameras_[pixel.view];
  const Eigen::Vector3f direction_camera((pixel.u_px - camera.cx_px) / camera.fx_px,
                                         (pixel.v_px - camera.cy_px) / camera.fy_px, 1.0f);
  const float norm = direction_camera.norm();
  const Eigen::Vector3f direction = camera.R_object_camera * (direction_camera / norm);
  Ray ray;
  for (int a = 0; a < 3; ++a) {
    ray.origin[a] = camera.origin_unit[a];
    ray.direction[a] = direction[a];
    ray.target.rgb[a] = pixel.rgb[a] * (1.0f / 255.0f);
  }
  ray.jitter = jitter;
  ray.target.depth = pixel.z_mu > 0 ? pixel.z_mu * norm / unit_mu_ : -1.0f;
  ray.target.is_object = is_object;
  return ray;
}

Ray RaySet::Get(uint64_t step, int index) const {
  const PixelSampler::Choice choice = sampler_.At(step, index);
  const uint64_t draw = 8 * static_cast<uint64_t>(index);
  Ray ray = Through(choice.pixel, choice.is_object, RandomUniform(seed_, step, draw));
  ray.target.partner = choice.partner;
  if (config_.random_background) {
    for (int c = 0; c < 3; ++c) ray.target.background[c] = RandomUniform(seed_, step, draw + 1 + c);
  }
  return ray;
}

}  // namespace romap::nerf
