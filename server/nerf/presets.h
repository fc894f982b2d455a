#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// Names of whole configurations of the field engine, the default first.
std::vector<std::string> NerfPresetNames();

// The configuration of that name; nullopt when there is none:
//   fast   what NerfConfig starts with
//   paper  the paper's own ("Implementation Details"): 2^16 table entries, finest resolution 2048, one hidden layer of
//          64, 4096 rays of 32 samples spread evenly between entry and exit of the box, the losses L_rgb, L_rr, L_depth
//          and L_density alone, nothing carved, 300 steps with each new view. What the paper leaves open is as usual
//          for hash grids (Mueller et al., 2022): 16 levels, Adam with betas 0.9 and 0.99.
std::optional<NerfConfig> NerfPreset(const std::string& name);

}  // namespace romap::nerf
