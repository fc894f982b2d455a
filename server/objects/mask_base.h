#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "server/objects/silhouette.h"
#include "server/objects/silhouette_hull.h"

namespace romap::objects {

// Where the masks of an object end below. Heights are z in the Grid frame, map units.
struct MaskBase {
  // The object's bottom is not above this height, within the accuracy of the masks.
  double bound = 0;
  // The bottom itself, if the cameras surround the object. It is the bound unless the lower part of the object bulges
  // like a ball: then it is that of a ball that continues the surface at the bound.
  double bottom = 0;
  // The bottom of such a ball, even if the masks show no bulge: small masks do not show it.
  double lowest = 0;
};

// The ray through the lowest pixel of a mask must meet the object, and only where the other masks allow the object, so
// the highest such point of the ray bounds the bottom. Rays slightly above it show the slope of the surface there.
// `center`: approximate center of the object (Grid frame of `region`); `object_size_mu`: its diagonal. nullopt: fewer
// than three masks show their lower end, because the image or other objects cut it off.
std::optional<MaskBase> FindMaskBase(const HullRegion& region, const Eigen::Vector3d& center, double object_size_mu,
                                     const std::vector<Silhouette>& silhouettes);

}  // namespace romap::objects
