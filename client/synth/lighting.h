#pragma once

#include "client/synth/scene.h"

namespace romap::synth {

// Computes Scene::irradiance, the light that each vertex receives; the radiance of a surface is albedo * irradiance.
// Area lights are sampled on a grid with shadow rays (soft shadows), ambient light with cosine-weighted hemisphere rays
// (ambient occlusion; Zhukov et al., "An ambient light illumination model", 1998).
void BakeLight(Scene& scene);

}  // namespace romap::synth
