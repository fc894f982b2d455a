#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "server/objects/mask_extents.h"
#include "server/objects/silhouette.h"
#include "server/objects/silhouette_hull.h"

namespace romap::objects {

// An upright box in a Grid frame. Its own frame is the Grid frame rotated by `yaw_rad` about z.
struct UprightBox {
  double yaw_rad = 0;
  Eigen::Vector3d low = Eigen::Vector3d::Zero();  // corners, in the box's own frame, map units
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
};

// The evidence for a box besides silhouettes. Grid frame, map units.
struct BoxCriteria {
  HullRegion region;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // approximate center of the object
  double object_size_mu = 0;                         // largest diagonal of a mask's box, at the object's distance
  std::vector<Eigen::Vector3d> points;               // map points on the object
  std::optional<double> support_height;              // of the surface it stands on
  std::optional<double> bottom_bound = {};           // the bottom is not above it
  std::optional<UprightBox> previous;                // keeps faces stable where the other evidence is weak
};

// Finds the box whose outline in each image extends as far as the object's mask. The object touches all faces of its
// box but does not have to fill the corners, so an outline beyond the mask costs little and one that falls short costs
// much (the quantile loss of R. Koenker and G. Bassett, "Regression Quantiles", Econometrica 1978). An outline beyond a
// mask that is cut off by the image or by another object costs nothing. The cost grows at most linearly, and is bounded
// per image, so that a few wrong masks do not matter.
//
// All boxes of one search have the same yaw. Deterministic.
class BoxSearch {
 public:
  BoxSearch(const BoxCriteria& criteria, const std::vector<Silhouette>& silhouettes, double yaw_rad);

  // Cost of a box with the search's yaw, in map units times silhouettes.
  double Cost(const UprightBox& box) const;
  // The best box near `start`, by coordinate descent over its faces. `step_mu`: the first step.
  UprightBox Refine(const UprightBox& start, double step_mu) const;
  // Share of the silhouettes that the box covers in nearly all directions, 0..1: low when masks contradict each other.
  double Agreement(const UprightBox& box) const;
  // Mean distance by which the box's outline extends beyond the masks where these are not cut off, in terms of the
  // object's size: large when the object does not fill the corners of its box.
  double Looseness(const UprightBox& box) const;

 private:
  static constexpr size_t kHalf = kExtentDirections / 2;
  using Reaches = std::array<float, kExtentDirections>;
  // A silhouette: projection from the box's frame to a plane at the object's distance, in map units around the
  // projected center, and the extents of the mask in that plane.
  struct Target {
    Eigen::Matrix<float, 3, 4> P;
    Reaches reach_mu;
    std::array<bool, kExtentDirections> is_free;
  };

  void AddTarget(const Silhouette& silhouette);
  Reaches OutlineOf(const UprightBox& box, const Target& target) const;
  float SilhouetteCost(const UprightBox& box, const Target& target) const;
  double PriorCost(const UprightBox& box) const;
  bool TryMove(int axis, double low_step, double high_step, UprightBox* box, double* cost) const;

  BoxCriteria criteria_;  // its points in the box's frame, at most kMaxPoints
  double yaw_rad_ = 0;
  std::array<Eigen::Vector2f, kHalf> directions_;
  std::vector<Target> targets_;
};

}  // namespace romap::objects
