#include "server/objects/cuboid_fitter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/angles.h"
#include "common/statistics.h"
#include "server/objects/box_search.h"
#include "server/objects/footprint.h"
#include "server/objects/mask_base.h"
#include "server/objects/support_height.h"

namespace romap::objects {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Interval {
  double low = kInfinity;
  double high = -kInfinity;

  void Include(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  bool Contains(double value) const { return value >= low && value <= high; }
};

std::vector<double> Along(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& axis) {
  std::vector<double> values;
  values.reserve(points.size());
  for (const Eigen::Vector3d& p : points) values.push_back(axis.dot(p));
  return values;
}

Interval Bounds(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& axis) {
  Interval bounds;
  for (double value : Along(points, axis)) bounds.Include(value);
  return bounds;
}

// Bounds of the points without the outermost ones on either side.
Interval TrimmedBounds(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& axis) {
  constexpr double kTrimmed = 0.02;  // share of the points, on each side
  const std::vector<double> values = Along(points, axis);
  return {NearestQuantile(values, kTrimmed), NearestQuantile(values, 1 - kTrimmed)};
}

// The horizontal direction in which the hull is unbounded because all cameras look along it; nullopt when the cameras
// surround the object. A camera bounds the hull perpendicular to its view direction; cameras on opposite sides bound it
// in the same directions.
std::optional<Eigen::Vector3d> UnboundedDirection(const CuboidEvidence& evidence,
                                                  const std::vector<Silhouette>& silhouettes) {
  std::vector<double> azimuths;
  for (const Silhouette& silhouette : silhouettes) {
    const Eigen::Vector3d view = evidence.region.ToGrid(silhouette.CameraCenter()) - evidence.center;
    const double azimuth = std::atan2(view.y(), view.x());
    azimuths.push_back(azimuth < 0 ? azimuth + std::numbers::pi : azimuth);
  }
  if (azimuths.empty()) return std::nullopt;
  std::sort(azimuths.begin(), azimuths.end());
  double gap = azimuths.front() + std::numbers::pi - azimuths.back();
  double gap_middle = azimuths.back() + gap / 2;
  for (size_t i = 1; i < azimuths.size(); ++i) {
    if (azimuths[i] - azimuths[i - 1] <= gap) continue;
    gap = azimuths[i] - azimuths[i - 1];
    gap_middle = azimuths[i - 1] + gap / 2;
  }
  constexpr double kMaxGap_rad = 60 * kRadPerDeg;  // between view directions that bound the hull
  if (gap < kMaxGap_rad) return std::nullopt;
  const double direction = gap_middle + std::numbers::pi / 2;
  return Eigen::Vector3d(std::cos(direction), std::sin(direction), 0);
}

// Hull cells between two heights and, where no camera bounds them, within the depth of the points.
std::vector<Eigen::Vector3d> ClipCells(const CuboidEvidence& evidence, const Interval& heights,
                                       const std::optional<Eigen::Vector3d>& unbounded) {
  constexpr double kDepthPerWidth = 0.7;  // half depth without points, in terms of the width
  constexpr double kPointsMargin = 0.2;   // around the points in depth, in terms of the width
  const double half_cell = evidence.cell_size.z() / 2;
  std::vector<Eigen::Vector3d> cells;
  for (const Eigen::Vector3d& cell : evidence.hull_cells) {
    if (cell.z() >= heights.low - half_cell && cell.z() <= heights.high + half_cell) cells.push_back(cell);
  }
  if (!unbounded || cells.empty()) return cells;
  const Eigen::Vector3d across = unbounded->cross(Eigen::Vector3d::UnitZ());
  const Interval sides = Bounds(cells, across);
  const double width = sides.high - sides.low;
  Interval depths{unbounded->dot(evidence.center) - kDepthPerWidth * width,
                  unbounded->dot(evidence.center) + kDepthPerWidth * width};
  if (evidence.points.size() >= static_cast<size_t>(evidence.min_points)) {
    depths = TrimmedBounds(evidence.points, *unbounded);
    depths = {depths.low - kPointsMargin * width, depths.high + kPointsMargin * width};
  }
  std::erase_if(cells, [&](const Eigen::Vector3d& cell) { return !depths.Contains(unbounded->dot(cell)); });
  return cells;
}

// Lowest and highest height of the ray inside the upright prism over the footprint; nullopt when it misses the prism.
std::optional<Interval> HeightsInsidePrism(const Footprint& footprint, const Eigen::Vector3d& origin,
                                           const Eigen::Vector3d& direction) {
  const Eigen::Rotation2Dd to_footprint(-footprint.yaw_rad);
  const Eigen::Vector2d o = to_footprint * (origin.head<2>() - footprint.center);
  const Eigen::Vector2d d = to_footprint * direction.head<2>();
  double near = 0;
  double far = kInfinity;
  for (int axis = 0; axis < 2; ++axis) {
    const double t0 = (-footprint.half_extents[axis] - o[axis]) / d[axis];
    const double t1 = (footprint.half_extents[axis] - o[axis]) / d[axis];
    near = std::max(near, std::min(t0, t1));
    far = std::min(far, std::max(t0, t1));
  }
  if (!(near < far) || !std::isfinite(far)) return std::nullopt;
  Interval heights;
  heights.Include(origin.z() + near * direction.z());
  heights.Include(origin.z() + far * direction.z());
  return heights;
}

// The highest bottom and the lowest top with which a box over the footprint still covers every silhouette: each ray of
// an outline must intersect the box. Quantiles ignore bad rays and outlines. nullopt without outlines.
std::optional<Interval> CoveringHeights(const CuboidEvidence& evidence, const std::vector<Silhouette>& silhouettes,
                                        const Footprint& footprint) {
  constexpr size_t kMinRays = 8;            // of an outline
  constexpr double kRaysOutside = 0.02;     // share of an outline's rays that may miss the box, at either end
  constexpr double kOutlinesOutside = 0.1;  // share of the outlines, likewise
  std::vector<double> tops;
  std::vector<double> bottoms;
  for (const Silhouette& silhouette : silhouettes) {
    const Eigen::Vector3d origin = evidence.region.ToGrid(silhouette.CameraCenter());
    std::vector<double> lows;
    std::vector<double> highs;
    for (const Eigen::Vector3d& ray : silhouette.outline_rays_world) {
      const auto heights = HeightsInsidePrism(footprint, origin, evidence.region.R_world_grid.transpose() * ray);
      if (!heights) continue;
      lows.push_back(heights->low);
      highs.push_back(heights->high);
    }
    if (lows.size() < kMinRays) continue;
    tops.push_back(NearestQuantile(lows, 1 - kRaysOutside));
    bottoms.push_back(NearestQuantile(highs, kRaysOutside));
  }
  if (tops.empty()) return std::nullopt;
  return Interval{NearestQuantile(bottoms, kOutlinesOutside), NearestQuantile(tops, 1 - kOutlinesOutside)};
}

// The range of heights in which a hull is broad. Above and below it, every visual hull tapers like a cone.
Interval BroadHeights(const std::vector<Eigen::Vector3d>& cells, double cell_height) {
  constexpr double kBroadShare = 0.2;          // of the largest layer's area
  std::vector<std::pair<double, int>> layers;  // height and number of cells; cells are ordered by layers
  for (const Eigen::Vector3d& cell : cells) {
    if (layers.empty() || cell.z() > layers.back().first + cell_height / 2) layers.emplace_back(cell.z(), 0);
    ++layers.back().second;
  }
  int largest = 0;
  for (const auto& layer : layers) largest = std::max(largest, layer.second);
  Interval heights;
  for (const auto& [height, count] : layers) {
    if (count < kBroadShare * largest) continue;
    heights.Include(height - cell_height / 2);
    heights.Include(height + cell_height / 2);
  }
  return heights;
}

UprightBox BoxOver(const Footprint& footprint, const Interval& heights) {
  const Eigen::Vector2d center = Eigen::Rotation2Dd(-footprint.yaw_rad) * footprint.center;
  UprightBox box{.yaw_rad = footprint.yaw_rad};
  box.low << center - footprint.half_extents, heights.low;
  box.high << center + footprint.half_extents, heights.high;
  return box;
}

// Compensates for a bias of the search. An object that does not fill the corners of its box (a ball, a plant) gets a
// box that is too small, because the outline of the true box extends beyond the masks at the corners in every view. The
// bias grows with the looseness: boxes have a looseness of 0.01, solids of revolution of 0.1 and a bias of a tenth of
// their width. The bottom is that of the support. The top of round objects is that of the points and outlines, because
// few views observe the top from above. The hull's other faces are not used: it is much wider where something occluded
// the object.
UprightBox Loosened(UprightBox tight, double outer_top, double looseness) {
  constexpr double kBoxLike = 0.02;  // looseness up to which a box needs no correction
  constexpr double kGrowth = 1.2;    // share of the width, per looseness
  const double growth = kGrowth * std::max(0.0, looseness - kBoxLike);
  const Eigen::Vector2d grown = growth / 2 * (tight.high - tight.low).head<2>();
  tight.low.head<2>() -= grown;
  tight.high.head<2>() += grown;
  constexpr double kFlatTop = 0.07;   // looseness up to which the search determines the top correctly
  constexpr double kRoundTop = 0.09;  // looseness from which `outer_top` is used
  const double share = std::clamp((looseness - kFlatTop) / (kRoundTop - kFlatTop), 0.0, 1.0);
  tight.high.z() += share * std::max(0.0, outer_top - tight.high.z());
  return tight;
}

// The previous cuboid as a box; nullopt when its yaw differs from `yaw_rad`, so that its faces do not correspond.
std::optional<UprightBox> AtYaw(const std::optional<Cuboid>& cuboid, const HullRegion& region, double yaw_rad) {
  constexpr double kSameYawRad = 0.03;
  if (!cuboid) return std::nullopt;
  if (std::abs(std::remainder(YawInGrid(*cuboid, region.R_world_grid) - yaw_rad, 2 * std::numbers::pi)) > kSameYawRad) {
    return std::nullopt;
  }
  const Eigen::Vector3d center =
      Eigen::AngleAxisd(-yaw_rad, Eigen::Vector3d::UnitZ()) * region.ToGrid(cuboid->T_world_object.translation());
  return UprightBox{yaw_rad, center - cuboid->half_extents, center + cuboid->half_extents};
}

// Smallest box around two boxes of the same yaw.
UprightBox United(const UprightBox& a, const UprightBox& b) {
  return {.yaw_rad = a.yaw_rad, .low = a.low.cwiseMin(b.low), .high = a.high.cwiseMax(b.high)};
}

Cuboid InWorld(const UprightBox& box, const HullRegion& region) {
  const Eigen::AngleAxisd yaw(box.yaw_rad, Eigen::Vector3d::UnitZ());
  Cuboid cuboid;
  cuboid.T_world_object = {Eigen::Matrix3d(region.R_world_grid * yaw.toRotationMatrix()),
                           region.ToWorld(yaw * Eigen::Vector3d((box.low + box.high) / 2))};
  cuboid.half_extents = (box.high - box.low) / 2;
  return cuboid;
}

bool HasEnoughPoints(const CuboidEvidence& evidence) {
  return evidence.points.size() >= static_cast<size_t>(evidence.min_points);
}

// The initial box: the footprint of the hull between heights from the support, the points and the outlines.
std::optional<UprightBox> FindOuterBox(const CuboidEvidence& evidence, const std::vector<Silhouette>& silhouettes,
                                       const std::optional<Eigen::Vector3d>& unbounded, std::optional<double> support,
                                       const std::optional<Cuboid>& previous) {
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  const Interval hull = Bounds(evidence.hull_cells, up);
  const Interval broad = BroadHeights(evidence.hull_cells, evidence.cell_size.z());
  const bool enough_points = HasEnoughPoints(evidence);
  const Interval points = enough_points ? TrimmedBounds(evidence.points, up) : broad;
  // A few points may all be in the lower part of the object; many points are spread over its height.
  constexpr size_t kManyPoints = 3;  // times the minimum
  const bool points_reach_top = evidence.points.size() >= kManyPoints * static_cast<size_t>(evidence.min_points);
  Interval heights{support.value_or(points.low), points_reach_top ? points.high : std::max(points.high, broad.high)};
  std::optional<double> previous_yaw;
  if (previous) previous_yaw = YawInGrid(*previous, evidence.region.R_world_grid);

  std::optional<Footprint> footprint;
  for (int pass = 0; pass < 2; ++pass) {  // the second pass uses the heights of the first one
    const std::vector<Eigen::Vector3d> cells = ClipCells(evidence, heights, unbounded);
    footprint = FitFootprint(cells, evidence.cell_size, previous_yaw, evidence.edge_yaw_rad);
    if (!footprint) return std::nullopt;
    // A footprint clipped to the points may be too short at its far end, and heights that cover it would be too low.
    if (unbounded && enough_points) break;
    const auto covering = CoveringHeights(evidence, silhouettes, *footprint);
    if (!covering) break;
    heights.high = std::min(std::max(heights.high, covering->high), hull.high + evidence.cell_size.z());
    if (!support) heights.low = std::max(std::min(heights.low, covering->low), hull.low - evidence.cell_size.z());
  }
  if (!(heights.high > heights.low)) return std::nullopt;
  return BoxOver(*footprint, heights);
}

}  // namespace

std::optional<CuboidFit> FitCuboid(const CuboidEvidence& evidence, const std::vector<Silhouette>& silhouettes,
                                   const std::optional<Cuboid>& previous) {
  if (evidence.hull_cells.empty()) return std::nullopt;
  const std::optional<Eigen::Vector3d> unbounded = UnboundedDirection(evidence, silhouettes);
  const auto mask_base = FindMaskBase(evidence.region, evidence.center, evidence.object_size_mu, silhouettes);
  const std::optional<double> support = FindSupportHeight(evidence, mask_base);
  // Without a support, the masks of cameras all around the object still show its lower end.
  std::optional<double> bottom_bound;
  if (mask_base && !support) bottom_bound = unbounded ? mask_base->bound : mask_base->bottom;
  const auto outer = FindOuterBox(evidence, silhouettes, unbounded, support, previous);
  if (!outer) return std::nullopt;
  const BoxSearch search({.region = evidence.region,
                          .center = evidence.center,
                          .object_size_mu = evidence.object_size_mu,
                          .points = HasEnoughPoints(evidence) ? evidence.points : std::vector<Eigen::Vector3d>{},
                          .support_height = support,
                          .bottom_bound = bottom_bound,
                          .previous = AtYaw(previous, evidence.region, outer->yaw_rad)},
                         silhouettes, outer->yaw_rad);
  constexpr double kFirstStep = 0.1;  // of the object's size
  const UprightBox tight = search.Refine(*outer, kFirstStep * evidence.object_size_mu);
  const UprightBox box = Loosened(tight, outer->high.z(), search.Looseness(tight));
  CuboidFit fit{.cuboid = InWorld(box, evidence.region), .training_box = InWorld(United(box, *outer), evidence.region)};
  constexpr double kTrainingMargin = 0.02;  // of the object's size: about the error of mask borders and of cells
  fit.training_box.half_extents.array() += kTrainingMargin * evidence.object_size_mu;
  fit.cuboid.confidence = search.Agreement(box);
  const bool usable = fit.training_box.half_extents.allFinite() && fit.training_box.T_world_object.IsFinite();
  return usable ? std::optional(fit) : std::nullopt;
}

}  // namespace romap::objects
