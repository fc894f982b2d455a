#pragma once

namespace romap::nerf {

// Weights and parameters of the loss terms of a ray (losses.h), the same for every ray of a training. All weights >= 0.
struct LossWeights {
  float opacity_object = 0;        // loss_opacity.h
  float opacity_background = 0;    // loss_opacity.h
  float density = 0;               // loss_density.h
  float depth = 0;                 // loss_depth.h
  float contrast = 0;              // loss_color.h
  float depth_limit = 0;           // loss_depth.h: larger depth errors are outliers [box sides]
  bool random_background = false;  // loss_color.h: object and background rays are blended over the random color
};

}  // namespace romap::nerf
