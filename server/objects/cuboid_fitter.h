#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "common/cuboid.h"
#include "server/objects/silhouette.h"
#include "server/objects/silhouette_hull.h"

namespace romap::objects {

// All that speaks for the box of one object. Points and cells are in the Grid frame of `region`.
struct CuboidEvidence {
  HullRegion region;
  std::vector<Eigen::Vector3d> hull_cells;  // centres of the cells the silhouettes leave
  Eigen::Vector3d cell_size = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> points;               // map points on the object, outliers removed
  std::vector<Eigen::Vector3d> background;           // map points that belong to no object
  std::vector<double> neighbour_bottoms;             // heights of what other objects stand on
  std::vector<double> carrier_tops;                  // heights of the tops of other objects below its middle
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // where the rays through the masks' middles meet
  double object_size_mu = 0;                         // largest diagonal of a mask's box, at the object's distance
  std::optional<double> edge_yaw_rad;                // of its straight edges, in the grid; only when they agree
  int min_points = 8;                                // fewer points do not say how far the object reaches
};

struct CuboidFit {
  Cuboid cuboid;
  // The box of what the evidence leaves for the object: at least as large, with the same axes. A thin part that few
  // masks show is in it, so fields learn in this one.
  Cuboid reach;
};

// The upright box around an object. The hull, the points and the support plane give a first box, BoxSearch the one that
// agrees best with all of them: a hull is only an outer bound, loose where neighbours hide the object or the cameras
// stand on one side, and it wears a cone on every flat top. Yaw: the straight edges', else the rectangle of least area
// around the footprint; `previous` wins over equally good ones and decides which of the four names of the same box is
// used. The confidence is the share of silhouettes that agree with the box. nullopt when the evidence leaves no volume.
std::optional<CuboidFit> FitCuboid(const CuboidEvidence& evidence, const std::vector<Silhouette>& silhouettes,
                                   const std::optional<Cuboid>& previous);

// Height (Grid z) of the horizontal surface that the object stands on: the top of another object below it, else the
// densest thin layer of background points around its footprint, else the median bottom of its neighbours. nullopt when
// none is there.
std::optional<double> FindSupportHeight(const CuboidEvidence& evidence);

}  // namespace romap::objects
