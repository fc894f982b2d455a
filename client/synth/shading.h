#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "client/synth/material.h"
#include "client/synth/scene.h"
#include "common/geometry.h"

namespace romap::synth {

// Radiance of a triangle where a ray of the camera hits it. `ray_camera` has z = 1 and may hit the plane of the
// triangle slightly outside. The result is filtered for an area of `pixel_rad` squared, the tangent of the angle that a
// sample covers.
Rgb Radiance(const Scene& scene, int32_t triangle, const SE3<World, Camera>& T_world_camera,
             const Eigen::Vector3d& ray_camera, float inverse_depth, float pixel_rad);

// Converts linear intensity 0..1 to an 8-bit sRGB value (IEC 61966-2-1). Other values are clamped.
uint8_t ToSrgb8(float linear);

}  // namespace romap::synth
