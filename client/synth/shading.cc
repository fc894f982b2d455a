#include "client/synth/shading.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "client/render/rasterizer.h"

namespace romap::synth {

Rgb Radiance(const Scene& scene, int32_t triangle, const SE3<World, Camera>& T_world_camera,
             const Eigen::Vector3d& ray_camera, float inverse_depth, float pixel_rad) {
  const std::array<uint32_t, 3>& corner = scene.triangles[static_cast<size_t>(triangle)];
  const std::array<Eigen::Vector3f, 3> world = {scene.positions_world[corner[0]], scene.positions_world[corner[1]],
                                                scene.positions_world[corner[2]]};
  const Eigen::Vector3d ray = T_world_camera.rotation() * ray_camera;
  // The pixel center may be outside the triangle that a sample hit.
  Eigen::Vector3f weights = render::Barycentrics(world, T_world_camera.translation(), ray).cwiseMax(0.0F);
  weights /= weights.sum();
  const auto blend = [&](const auto& attribute) -> Eigen::Vector3f {
    return weights.x() * attribute[corner[0]] + weights.y() * attribute[corner[1]] + weights.z() * attribute[corner[2]];
  };
  const Eigen::Vector3f normal_world = (world[1] - world[0]).cross(world[2] - world[0]).normalized();
  const auto& local = scene.positions_local;
  const Eigen::Vector3f normal_local =
      (local[corner[1]] - local[corner[0]]).cross(local[corner[2]] - local[corner[0]]).normalized();
  // On a slanted surface the footprint of a pixel is longer in one direction; use the geometric mean of both.
  const float cosine = std::abs(normal_world.dot(ray.cast<float>().normalized()));
  const float footprint_m = pixel_rad / (inverse_depth * std::sqrt(std::max(cosine, 0.05F)));
  const Material& material = scene.surfaces[scene.surface_of_triangle[static_cast<size_t>(triangle)]].material;
  return Albedo(material, blend(local), normal_local, footprint_m).cwiseProduct(blend(scene.irradiance));
}

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

}  // namespace romap::synth
