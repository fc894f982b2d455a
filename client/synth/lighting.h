#pragma once

#include "client/synth/scene.h"

namespace romap::synth {

// Fills in Scene::irradiance: the light that reaches each vertex, so that a surface's radiance is albedo * irradiance.
// Area lights are sampled on a grid with shadow rays (soft shadows), ambient light through cosine-weighted hemisphere
// rays (ambient occlusion; Zhukov et al., "An ambient light illumination model", 1998). The scene does not move, so
// this is done once.
void BakeLight(Scene& scene);

}  // namespace romap::synth
