#pragma once

#include "tests/support/synthetic_world.h"

namespace romap::objects {

// Sixty small frames around a table with four objects, every second one a keyframe.
inline SyntheticWorldOptions SmallWorld() {
  SyntheticWorldOptions options;
  options.width_px = 240;
  options.height_px = 180;
  options.focal_px = 225;
  options.frames = 60;
  options.keyframe_every = 2;
  options.points_on_table = 100;
  return options;
}

}  // namespace romap::objects
