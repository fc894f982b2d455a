#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "common/cuboid.h"
#include "server/objects/silhouette.h"
#include "server/objects/silhouette_hull.h"

namespace romap::objects {

// The evidence for the cuboid of one object. Points, cells and heights (z) are in the Grid frame of `region`.
struct CuboidEvidence {
  HullRegion region;
  std::vector<Eigen::Vector3d> hull_cells;  // centers of the cells of the visual hull
  Eigen::Vector3d cell_size = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> points;               // map points on the object, outliers removed
  std::vector<Eigen::Vector3d> background;           // map points that belong to no object
  std::vector<double> neighbor_bottoms;              // heights of the bottoms of other objects
  std::vector<double> supporting_tops;               // heights of the tops of objects that may support it
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // where the rays through the middles of the masks intersect
  double object_size_mu = 0;                         // largest diagonal of a mask's box, at the object's distance
  std::optional<double> edge_yaw_rad;                // of its straight edges; only when they agree
  int min_points = 8;                                // with fewer points, the points do not bound the object
};

struct CuboidFit {
  Cuboid cuboid;
  // The space that the evidence allows for the object: at least as large as the cuboid, with the same axes. It contains
  // thin parts that are visible in only a few masks, so fields are trained in it.
  Cuboid training_box;
};

// Fits the upright cuboid around an object. The hull, the points and the support plane give an initial box, which
// BoxSearch refines to the box that agrees best with all of them: a hull is only an outer bound, loose where neighbors
// occlude the object or all cameras are on one side, and cone-shaped above every flat top. The yaw is that of the
// straight edges, or without edges that of the smallest rectangle around the footprint; `previous` decides between
// equally good ones and between the four equivalent yaws of a box. The confidence is the share of silhouettes that
// agree with the cuboid. nullopt if the evidence excludes the whole volume.
std::optional<CuboidFit> FitCuboid(const CuboidEvidence& evidence, const std::vector<Silhouette>& silhouettes,
                                   const std::optional<Cuboid>& previous);

}  // namespace romap::objects
