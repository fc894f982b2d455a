#pragma once

namespace romap::nerf {

// What is known about the quality of an object's views, besides the trust in single views.
struct InputQuality {
  // Whether dense depth is consistent with the masks; otherwise it is not used. See DepthIsConsistent().
  bool depth_is_consistent = true;
  // Background pixels this close to the object's mask may show the object, because the border of the mask is imprecise.
  // See UncertainBorder_px().
  int mask_border_px = 0;
};

}  // namespace romap::nerf
