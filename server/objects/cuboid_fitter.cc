#include "server/objects/cuboid_fitter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/statistics.h"
#include "server/objects/box_search.h"
#include "server/objects/footprint.h"

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

// Bounds of the points without the outermost 2 % on either side.
Interval TrimmedBounds(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& axis) {
  const std::vector<double> values = Along(points, axis);
  return {NearestQuantile(values, 0.02), NearestQuantile(values, 0.98)};
}

// The horizontal direction in which the hull is unbounded because all cameras look along it; nullopt when they stand
// around the object. A camera bounds the hull across its direction of view, from either side alike.
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
  constexpr double kWidestHarmlessGap = 60 * std::numbers::pi / 180;
  if (gap < kWidestHarmlessGap) return std::nullopt;
  const double direction = gap_middle + std::numbers::pi / 2;
  return Eigen::Vector3d(std::cos(direction), std::sin(direction), 0);
}

// Hull cells between two heights and, where no camera bounds them, within the depth of the points.
std::vector<Eigen::Vector3d> ClipCells(const CuboidEvidence& evidence, const Interval& heights,
                                       const std::optional<Eigen::Vector3d>& unbounded) {
  const double half_cell = evidence.cell_size.z() / 2;
  std::vector<Eigen::Vector3d> cells;
  for (const Eigen::Vector3d& cell : evidence.hull_cells) {
    if (cell.z() >= heights.low - half_cell && cell.z() <= heights.high + half_cell) cells.push_back(cell);
  }
  if (!unbounded || cells.empty()) return cells;
  const Eigen::Vector3d across = unbounded->cross(Eigen::Vector3d::UnitZ());
  const Interval sides = Bounds(cells, across);
  const double width = sides.high - sides.low;
  Interval depths{unbounded->dot(evidence.center) - 0.7 * width, unbounded->dot(evidence.center) + 0.7 * width};
  if (evidence.points.size() >= static_cast<size_t>(evidence.min_points)) {
    depths = TrimmedBounds(evidence.points, *unbounded);
    depths = {depths.low - 0.2 * width, depths.high + 0.2 * width};
  }
  std::erase_if(cells, [&](const Eigen::Vector3d& cell) { return !depths.Contains(unbounded->dot(cell)); });
  return cells;
}

// Heights at which the ray, inside the upright prism over the footprint, is lowest and highest; nullopt when it misses.
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

// The lowest top and the highest bottom with which a box over the footprint still covers every silhouette: each ray of
// an outline must meet the box. Bad outlines are outvoted. nullopt without outlines.
std::optional<Interval> CoveringHeights(const CuboidEvidence& evidence, const std::vector<Silhouette>& silhouettes,
                                        const Footprint& footprint) {
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
    if (lows.size() < 8) continue;
    tops.push_back(NearestQuantile(lows, 0.98));
    bottoms.push_back(NearestQuantile(highs, 0.02));
  }
  if (tops.empty()) return std::nullopt;
  return Interval{NearestQuantile(bottoms, 0.1), NearestQuantile(tops, 0.9)};
}

// The heights between which a hull is broad. Above and below it tapers like the cones that every hull wears.
Interval BroadHeights(const std::vector<Eigen::Vector3d>& cells, double cell_height) {
  constexpr double kBroadShare = 0.2;
  std::vector<std::pair<double, int>> layers;  // cells come layer by layer
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

// A thing that leaves the corners of its box empty (a ball, a plant) gets a box that is too small: across the corners
// the outline reaches farther than the masks from whatever side, and the search gives in to that a little. What it
// gives in grows with the looseness: boxes have 0.01, things of revolution 0.1, and for these it is a tenth. The bottom
// is where the support says. The top is that of the points and outlines: little looks over it. Never the hull's other
// faces: it is much wider wherever something hid the object.
UprightBox Loosened(UprightBox tight, double outer_top, double looseness) {
  constexpr double kBoxLike = 0.02;
  constexpr double kGrowth = 1.2;
  const double growth = kGrowth * std::max(0.0, looseness - kBoxLike);
  const Eigen::Vector2d grown = growth / 2 * (tight.high - tight.low).head<2>();
  tight.low.head<2>() -= grown;
  tight.high.head<2>() += grown;
  constexpr double kFlatTop = 0.07;
  constexpr double kRoundTop = 0.09;
  const double share = std::clamp((looseness - kFlatTop) / (kRoundTop - kFlatTop), 0.0, 1.0);
  tight.high.z() += share * std::max(0.0, outer_top - tight.high.z());
  return tight;
}

// The previous cuboid as a box; nullopt when it is turned against `yaw_rad`, so that its faces are other ones.
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

// Boxes of the same yaw.
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

}  // namespace

std::optional<double> FindSupportHeight(const CuboidEvidence& evidence) {
  if (evidence.hull_cells.empty()) return std::nullopt;
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  const Interval hull = Bounds(evidence.hull_cells, up);
  const bool enough_points = evidence.points.size() >= static_cast<size_t>(evidence.min_points);
  // A surface above the lowest fifth of the object's own points cannot carry it.
  const double ceiling = enough_points ? NearestQuantile(Along(evidence.points, up), 0.2)
                                       : evidence.center.z() + 0.1 * evidence.object_size_mu;
  const double floor = std::min(hull.low, ceiling) - 0.3 * evidence.object_size_mu;
  const double layer_mu = 0.05 * evidence.object_size_mu;
  // What lies under the object hides the table there, and its own points are no background.
  std::optional<double> carrier;
  for (double top : evidence.carrier_tops) {
    if (top >= floor && top <= ceiling + layer_mu) carrier = std::max(top, carrier.value_or(top));
  }
  if (carrier) return carrier;
  std::vector<double> heights;
  for (const Eigen::Vector3d& p : evidence.background) {
    if ((p - evidence.center).head<2>().norm() > 1.3 * evidence.object_size_mu) continue;
    if (p.z() >= floor && p.z() <= ceiling + layer_mu) heights.push_back(p.z());
  }
  std::sort(heights.begin(), heights.end());
  size_t best_count = 0;
  double best_height = 0;
  for (size_t first = 0, last = 0; first < heights.size(); ++first) {
    while (last < heights.size() && heights[last] <= heights[first] + layer_mu) ++last;
    if (last - first <= best_count) continue;
    best_count = last - first;
    best_height = heights[first + best_count / 2];
  }
  constexpr size_t kFewestSupportPoints = 6;
  if (best_count >= kFewestSupportPoints) return best_height;
  std::vector<double> bottoms;
  for (double bottom : evidence.neighbour_bottoms) {
    if (bottom >= floor && bottom <= ceiling + layer_mu) bottoms.push_back(bottom);
  }
  if (bottoms.empty()) return std::nullopt;
  return NearestQuantile(bottoms, 0.5);
}

std::optional<CuboidFit> FitCuboid(const CuboidEvidence& evidence, const std::vector<Silhouette>& silhouettes,
                                   const std::optional<Cuboid>& previous) {
  if (evidence.hull_cells.empty()) return std::nullopt;
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  const std::optional<double> support = FindSupportHeight(evidence);
  const std::optional<Eigen::Vector3d> unbounded = UnboundedDirection(evidence, silhouettes);
  const Interval hull = Bounds(evidence.hull_cells, up);
  const Interval broad = BroadHeights(evidence.hull_cells, evidence.cell_size.z());
  const bool enough_points = evidence.points.size() >= static_cast<size_t>(evidence.min_points);
  const Interval points = enough_points ? TrimmedBounds(evidence.points, up) : broad;
  // A few points may all lie low on the object; many do not.
  const bool points_reach_top = evidence.points.size() >= 3 * static_cast<size_t>(evidence.min_points);
  Interval heights{support.value_or(points.low), points_reach_top ? points.high : std::max(points.high, broad.high)};

  std::optional<Footprint> footprint;
  for (int pass = 0; pass < 2; ++pass) {  // the second pass uses the height that the first one found
    const std::vector<Eigen::Vector3d> cells = ClipCells(evidence, heights, unbounded);
    std::optional<double> previous_yaw;
    if (previous) previous_yaw = YawInGrid(*previous, evidence.region.R_world_grid);
    footprint = FitFootprint(cells, evidence.cell_size, previous_yaw, evidence.edge_yaw_rad);
    if (!footprint) return std::nullopt;
    // A footprint that was cut to the points may be too short at its far end, and a box over it too low to cover.
    if (unbounded && enough_points) break;
    const auto covering = CoveringHeights(evidence, silhouettes, *footprint);
    if (!covering) break;
    heights.high = std::min(std::max(heights.high, covering->high), hull.high + evidence.cell_size.z());
    if (!support) heights.low = std::max(std::min(heights.low, covering->low), hull.low - evidence.cell_size.z());
  }
  if (!(heights.high > heights.low)) return std::nullopt;

  const BoxSearch search({.region = evidence.region,
                          .center = evidence.center,
                          .object_size_mu = evidence.object_size_mu,
                          .points = enough_points ? evidence.points : std::vector<Eigen::Vector3d>{},
                          .support_height = support,
                          .previous = AtYaw(previous, evidence.region, footprint->yaw_rad)},
                         silhouettes, footprint->yaw_rad);
  constexpr double kFirstStep = 0.1;  // of the size
  const UprightBox outer = BoxOver(*footprint, heights);
  const UprightBox tight = search.Refine(outer, kFirstStep * evidence.object_size_mu);
  const UprightBox box = Loosened(tight, outer.high.z(), search.Looseness(tight));
  CuboidFit fit{.cuboid = InWorld(box, evidence.region), .reach = InWorld(United(box, outer), evidence.region)};
  constexpr double kReachMargin = 0.02;  // of the size: borders of masks and of cells err by about so much
  fit.reach.half_extents.array() += kReachMargin * evidence.object_size_mu;
  fit.cuboid.confidence = search.Agreement(box);
  const bool usable = fit.reach.half_extents.allFinite() && fit.reach.T_world_object.IsFinite();
  return usable ? std::optional(fit) : std::nullopt;
}

}  // namespace romap::objects
