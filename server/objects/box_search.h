#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "server/objects/mask_extents.h"
#include "server/objects/silhouette.h"
#include "server/objects/silhouette_hull.h"

namespace romap::objects {

// An upright box in a Grid frame: its own frame is the Grid frame turned by `yaw_rad` about z.
struct UprightBox {
  double yaw_rad = 0;
  Eigen::Vector3d low = Eigen::Vector3d::Zero();  // corners, in the box's own frame, map units
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
};

// What a box is judged by, besides silhouettes. Grid frame, map units.
struct BoxCriteria {
  HullRegion region;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // about where the object is
  double object_size_mu = 0;                         // largest diagonal of a mask's box, at the object's distance
  std::vector<Eigen::Vector3d> points;               // map points on the object
  std::optional<double> support_height;              // of what it stands on
  std::optional<UprightBox> previous;                // its faces stay where little speaks against it
};

// Finds the box whose outline in each picture reaches as far as the object's mask does. The object touches all faces of
// its box but need not fill the corners, so an outline that reaches farther than a mask costs little, one that falls
// short costs much (the quantile loss of R. Koenker and G. Bassett, "Regression Quantiles", Econometrica 1978). Where
// something else ends a mask, or the image does, reaching farther costs nothing. The cost grows no faster than linearly
// and per picture only up to a limit, so that masks that lie are outvoted.
//
// All boxes that one search judges have the same yaw. Deterministic.
class BoxSearch {
 public:
  BoxSearch(const BoxCriteria& criteria, const std::vector<Silhouette>& silhouettes, double yaw_rad);

  // What speaks against a box of the search's yaw, map units times silhouettes.
  double Cost(const UprightBox& box) const;
  // The best box near `start`, found face by face. `step_mu`: how far faces move at first.
  UprightBox Refine(const UprightBox& start, double step_mu) const;
  // Share of the silhouettes that the box covers in nearly all directions: low when masks contradict each other.
  double Agreement(const UprightBox& box) const;
  // By how much, on average, the box's outline reaches farther than the masks where those end freely, in terms of the
  // object's size: large when the object does not fill the corners of its box.
  double Looseness(const UprightBox& box) const;

 private:
  static constexpr size_t kHalf = kExtentDirections / 2;
  using Reaches = std::array<float, kExtentDirections>;
  // A silhouette as the search needs it: projection from the box's frame to a plane at the object's distance, in map
  // units around the image of the centre.
  struct Target {
    Eigen::Matrix<float, 3, 4> P;
    Reaches reach_mu;
    std::array<bool, kExtentDirections> ends_freely;
  };

  void AddTarget(const Silhouette& silhouette);
  Reaches OutlineOf(const UprightBox& box, const Target& target) const;
  float SilhouetteCost(const UprightBox& box, const Target& target) const;
  double PriorCost(const UprightBox& box) const;
  bool TryMove(int axis, double low_step, double high_step, UprightBox* box, double* cost) const;

  BoxCriteria criteria_;  // its points turned into the box's frame, and thinned
  double yaw_rad_ = 0;
  std::array<Eigen::Vector2f, kHalf> directions_;
  std::vector<Target> targets_;
};

}  // namespace romap::objects
