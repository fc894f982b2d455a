#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "server/objects/silhouette.h"
#include "server/objects/silhouette_hull.h"

namespace romap::objects {

// Height (z in the Grid frame of `region`, map units) that the masks of an object reach down to: its bottom is not
// above this height, within the accuracy of the masks. The ray through the lowest pixel of a mask must meet the object,
// and only where the other masks allow the object, so the highest such point of the ray bounds the bottom. If the
// cameras surround the object, the bound is the bottom itself, except for objects whose lower part bulges (balls): then
// it is above the bottom. `center`: approximate center of the object (Grid frame); `object_size_mu`: its diagonal.
// nullopt: fewer than three masks show their lower end, because the image or other objects cut it off.
std::optional<double> FindMaskBase(const HullRegion& region, const Eigen::Vector3d& center, double object_size_mu,
                                   const std::vector<Silhouette>& silhouettes);

}  // namespace romap::objects
