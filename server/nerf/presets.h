#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// Names of the presets of NerfConfig, the default first.
std::vector<std::string> NerfPresetNames();

// The preset of this name; nullopt if there is none:
//   fast   the defaults of NerfConfig
//   paper  the settings of the paper ("Implementation Details"): 2^16 table entries, finest resolution 2048, one hidden
//          layer of 64 neurons, 4096 rays with 32 samples spread evenly between entry and exit of the box, only the
//          losses L_rgb, L_rr, L_depth and L_density, no carving by the visual hull, 300 steps per new view. Settings
//          that the paper does not give have the usual values of hash grids (Mueller et al., 2022): 16 levels, Adam
//          with betas 0.9 and 0.99.
std::optional<NerfConfig> NerfPreset(const std::string& name);

}  // namespace romap::nerf
