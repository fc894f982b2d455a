#include "server/slam/patch_search.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "server/slam/features/feature.h"

namespace romap::slam {
namespace {

constexpr double kMinFoundCorrelation = 0.85;
constexpr double kMinPatchCosine = 0.87;  // 30 degrees between the reference's ray and the new one
constexpr double kMinOctaveScale = 0.7;

}  // namespace

std::optional<Eigen::Matrix2d> PixelsByReferencePixels(const CameraModel& camera,
                                                       const SE3<Camera, World>& T_camera_world,
                                                       const SE3<World, Camera>& T_world_reference,
                                                       const Eigen::Vector3d& p_world) {
  const Eigen::Vector3d p_reference = T_world_reference.Inverse() * p_world;
  const Eigen::Vector3d p_camera = T_camera_world * p_world;
  if (!(p_reference.z() > 0) || !(p_camera.z() > 0)) return std::nullopt;
  // The plane through the point, perpendicular to its ray: moving by one pixel along the image moves the point on it.
  const Eigen::Vector3d normal = p_reference.normalized();
  Eigen::Matrix<double, 3, 2> step;
  for (int axis = 0; axis < 2; ++axis) {
    Eigen::Vector3d ray_step = Eigen::Vector3d::Zero();
    ray_step[axis] = p_reference.z() / (axis == 0 ? camera.fx_px : camera.fy_px);
    // Along the ray, back onto the plane.
    step.col(axis) = ray_step - p_reference * (normal.dot(ray_step) / normal.dot(p_reference));
  }
  const Eigen::Matrix3d R_camera_reference =
      T_camera_world.rotation().toRotationMatrix() * T_world_reference.rotation().toRotationMatrix();
  const double inverse_z = 1 / p_camera.z();
  Eigen::Matrix<double, 2, 3> projection;
  projection << camera.fx_px * inverse_z, 0, -camera.fx_px * p_camera.x() * inverse_z * inverse_z,  //
      0, camera.fy_px * inverse_z, -camera.fy_px * p_camera.y() * inverse_z * inverse_z;
  return projection * (R_camera_reference * step);
}

std::optional<FoundPatch> FindPatch(const ReferencePatch& patch, const SE3<World, Camera>& T_world_reference,
                                    const Eigen::Vector3d& p_world, const PatchTarget& target) {
  const Eigen::Vector3d ray = p_world - target.center_world;
  const Eigen::Vector3d reference_ray = p_world - T_world_reference.translation();
  if (ray.dot(reference_ray) < kMinPatchCosine * ray.norm() * reference_ray.norm()) return std::nullopt;
  const Eigen::Vector3d p_camera = target.T_camera_world * p_world;
  if (!(p_camera.z() > 0)) return std::nullopt;
  Eigen::Vector2d image_px = target.lens.Distort(target.camera, target.camera.Project(p_camera));
  if (target.shutter != nullptr) {
    image_px = target.is_converted ? target.shutter->ToConverted(image_px, p_camera.z())
                                   : target.shutter->ToRolling(image_px, p_camera.z());
  }
  const auto by_reference_pixels =
      PixelsByReferencePixels(target.camera, target.T_camera_world, T_world_reference, p_world);
  if (!by_reference_pixels) return std::nullopt;
  const double octave_scale = patch.octave_scale * std::sqrt(std::abs(by_reference_pixels->determinant()));
  if (octave_scale < kMinOctaveScale || octave_scale > 1.2 * kMaxOctaveScale) return std::nullopt;
  const auto aligned = AlignPatch(patch.patch, target.image, patch.octave_scale * *by_reference_pixels, image_px);
  if (!aligned || aligned->correlation < kMinFoundCorrelation) return std::nullopt;
  const bool is_recorded = target.shutter != nullptr && !target.is_converted;
  return FoundPatch{.image_px = is_recorded ? target.shutter->ToGlobal(aligned->pixel_px, 0) : aligned->pixel_px,
                    .depth_mu = p_camera.z(),
                    .octave_scale = octave_scale};
}

}  // namespace romap::slam
