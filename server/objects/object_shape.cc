#include "server/objects/object_shape.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/statistics.h"
#include "server/objects/angles.h"
#include "server/objects/cuboid_fitter.h"
#include "server/objects/edge_yaw.h"
#include "server/objects/point_cuboid.h"
#include "server/objects/projection.h"

namespace romap::objects {
namespace {

Eigen::Vector3d MedianOf(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d median;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Eigen::Vector3d& p : points) values.push_back(p[axis]);
    median[axis] = Median(std::move(values));
  }
  return median;
}

std::optional<CuboidFit> FitToPoints(const CuboidEvidence& evidence) {
  const auto cuboid = CuboidOfPoints(evidence.region, evidence.points, evidence.edge_yaw_rad);
  if (!cuboid) return std::nullopt;
  return CuboidFit{.cuboid = *cuboid, .reach = *cuboid};
}

// Without a centre, the optical axis stands for the direction to the object: good enough to compare cameras.
Eigen::Vector3d ViewDirection(const Silhouette& silhouette) {
  const double u_px = silhouette.box_px.x + silhouette.box_px.width / 2.0;
  const double v_px = silhouette.box_px.y + silhouette.box_px.height / 2.0;
  return silhouette.T_world_camera.rotation() * silhouette.camera.Unproject(u_px, v_px);
}

}  // namespace

bool ObjectShape::IsRedundant(const Silhouette& silhouette) const {
  const double limit = config_.silhouette_angle_deg * kRadPerDeg;
  const Eigen::Vector3d direction = ViewDirection(silhouette);
  return std::any_of(silhouettes_.begin(), silhouettes_.end(), [&](const Silhouette& other) {
    return other.cut_by_border <= silhouette.cut_by_border && AngleBetween(ViewDirection(other), direction) < limit;
  });
}

bool ObjectShape::WantsSegments(const Silhouette& silhouette) const {
  constexpr double kSureConfidence = 0.5;
  constexpr size_t kSureViews = 8;
  if (edge_yaw_confidence_ > kSureConfidence && SegmentViews() >= kSureViews) return false;
  const double limit = 1.5 * config_.silhouette_angle_deg * kRadPerDeg;
  const Eigen::Vector3d direction = ViewDirection(silhouette);
  return std::none_of(silhouettes_.begin(), silhouettes_.end(), [&](const Silhouette& other) {
    return other.has_segments && AngleBetween(ViewDirection(other), direction) < limit;
  });
}

size_t ObjectShape::SegmentViews() const {
  return static_cast<size_t>(std::count_if(silhouettes_.begin(), silhouettes_.end(),
                                           [](const Silhouette& silhouette) { return silhouette.has_segments; }));
}

bool ObjectShape::AddSilhouette(Silhouette silhouette) {
  if (IsRedundant(silhouette)) return false;
  silhouettes_.push_back(std::move(silhouette));
  has_voted_.push_back(false);
  ++news_;
  if (silhouettes_.size() > static_cast<size_t>(config_.max_silhouettes)) MakeRoom();
  return true;
}

// Drops the silhouette whose direction is nearest to another one's: it says least that the others do not.
void ObjectShape::MakeRoom() {
  std::vector<Eigen::Vector3d> directions;
  for (const Silhouette& silhouette : silhouettes_) directions.push_back(ViewDirection(silhouette).normalized());
  size_t worst = 0;
  double highest_cosine = -2;
  for (size_t i = 0; i < directions.size(); ++i) {
    for (size_t j = i + 1; j < directions.size(); ++j) {
      const double cosine = directions[i].dot(directions[j]);
      if (cosine <= highest_cosine) continue;
      highest_cosine = cosine;
      worst = silhouettes_[i].cut_by_border ? i : j;
    }
  }
  Unvote(worst);
  silhouettes_.erase(silhouettes_.begin() + static_cast<std::ptrdiff_t>(worst));
  has_voted_.erase(has_voted_.begin() + static_cast<std::ptrdiff_t>(worst));
}

void ObjectShape::Unvote(size_t i) {
  if (has_voted_[i]) hull_.Remove(silhouettes_[i]);
  has_voted_[i] = false;
}

void ObjectShape::VoteForNews() {
  for (size_t i = 0; i < silhouettes_.size(); ++i) {
    if (!has_voted_[i]) hull_.Add(silhouettes_[i]);
    has_voted_[i] = true;
  }
}

bool ObjectShape::Correct(const Sim3<World, World>& S_new_old, const KeyframeCorrections& keyframes,
                          const std::optional<Cuboid>& cuboid) {
  constexpr double kLeastShift_px = 0.5;  // masks are not exact to less
  bool changed = false;
  hull_.Move(S_new_old);
  for (size_t i = 0; i < silhouettes_.size(); ++i) {
    Silhouette& silhouette = silhouettes_[i];
    Move(S_new_old, &silhouette);
    const auto corrected = keyframes.find(silhouette.keyframe);
    if (corrected != keyframes.end()) silhouette.corrected_T_world_camera = corrected->second.T_world_camera;
    if (cuboid && LargestShift_px(*cuboid, silhouette.camera, silhouette.T_world_camera,
                                  silhouette.corrected_T_world_camera) < kLeastShift_px) {
      continue;
    }
    Unvote(i);
    ApplyCorrectedPose(&silhouette);
    ++news_;
    changed = true;
  }
  return changed;
}

std::optional<ObjectShape::Extent> ObjectShape::EstimateExtent(const Surroundings& surroundings) const {
  constexpr double kGoodParallaxRad = 15 * kRadPerDeg;
  constexpr double kLeastParallaxRad = 5 * kRadPerDeg;
  const auto ray_center = IntersectCenterRays(silhouettes_, kLeastParallaxRad);
  const bool enough_points = surroundings.points.size() >= static_cast<size_t>(config_.min_object_points);
  if (!ray_center && !enough_points) return std::nullopt;
  Extent extent;
  extent.center_world = ray_center ? *ray_center : MedianOf(surroundings.points);
  if (ray_center && enough_points && ParallaxRad(silhouettes_, *ray_center) < kGoodParallaxRad) {
    extent.center_world = MedianOf(surroundings.points);
  }
  for (const Silhouette& silhouette : silhouettes_) {
    const double depth_mu = (silhouette.T_world_camera.Inverse() * extent.center_world).z();
    const double diagonal_px = std::hypot(silhouette.box_px.width, silhouette.box_px.height);
    extent.size_mu = std::max(extent.size_mu, diagonal_px * depth_mu / silhouette.camera.fx_px);
  }
  if (!(extent.size_mu > 0) || !std::isfinite(extent.size_mu)) return std::nullopt;
  return extent;
}

// Carving anew is also when the silhouettes learn where the other things in their pictures stand by now.
void ObjectShape::Carve(const HullRegion& region, const Surroundings& surroundings) {
  constexpr int kHullCells = 20;  // along each side of the grid
  hull_.Reset(region, kHullCells);
  forest_.reset();
  silhouettes_when_carved_ = silhouettes_.size();
  for (Silhouette& silhouette : silhouettes_) UpdateNeighbours(*surroundings.neighbours, &silhouette);
  has_voted_.assign(silhouettes_.size(), false);
  VoteForNews();
}

// Corrections turn the grid with its object; a fit needs it upright.
void ObjectShape::StraightenRegion(const Surroundings& surroundings) {
  constexpr double kMostTiltRad = 0.3 * kRadPerDeg;
  HullRegion region = hull_.region();
  const Eigen::Vector3d z = region.R_world_grid.col(2);
  if (AngleBetween(z, surroundings.up_world) < kMostTiltRad) return;
  region.R_world_grid = ShortestRotation(z, surroundings.up_world) * region.R_world_grid;
  Carve(region, surroundings);
}

// A bad mask must not eat the object, but every silhouette that may err makes the hull wider.
HullVotes ObjectShape::StrictVotes() const {
  const auto count = static_cast<int>(silhouettes_.size());
  return {.max_outside = count < 8 ? 0 : std::max(1, count / 20), .min_inside = std::max(1, count * 3 / 10)};
}

HullVotes ObjectShape::LenientVotes() const {
  const auto count = static_cast<int>(silhouettes_.size());
  return {.max_outside = std::max(1, count / 4), .min_inside = std::max(1, count * 3 / 10)};
}

// Moves the grid to where the hull is when it reaches the grid's border, or when there are many more silhouettes than
// at the last time: then it fills little of the grid.
void ObjectShape::RefocusRegion(const Extent& extent, const Surroundings& surroundings) {
  const Eigen::AlignedBox3d hull = hull_.Bounds(StrictVotes());
  if (hull.isEmpty()) return;
  const Eigen::Vector3d& low = hull.min();
  const Eigen::Vector3d& high = hull.max();
  const HullRegion& region = hull_.region();
  const Eigen::Vector3d reach = high.cwiseMax(-low).cwiseQuotient(region.half_extents);
  const double most_mu = 1.3 * extent.size_mu;
  const bool may_grow = (region.half_extents.array() < 0.99 * most_mu).any() && reach.maxCoeff() > 0.97;
  const bool much_news = silhouettes_.size() > 2.0 * static_cast<double>(silhouettes_when_carved_);
  const bool any_news = silhouettes_.size() != silhouettes_when_carved_;
  if (!much_news && !(may_grow && any_news)) return;
  HullRegion next = region;
  next.center_world = region.ToWorld((low + high) / 2);
  for (int axis = 0; axis < 3; ++axis) {
    const double growth = reach[axis] > 0.97 ? 1.6 : 1.25;
    next.half_extents[axis] = std::min(most_mu, growth * (high[axis] - low[axis]) / 2);
  }
  Carve(next, surroundings);
}

// Growing trees costs more than asking them, so they are kept while the points are nearly the same.
std::vector<double> ObjectShape::Loneliness(const std::vector<Eigen::Vector3d>& points_grid) {
  constexpr size_t kFewestPoints = 4;
  constexpr double kMostChange = 0.1;
  if (points_grid.size() < kFewestPoints) return std::vector<double>(points_grid.size(), 0.5);
  std::vector<Eigen::Vector3d> scaled;
  for (const Eigen::Vector3d& p : points_grid) scaled.emplace_back(p / hull_.region().half_extents.x());
  const double change = std::abs(static_cast<double>(scaled.size()) - static_cast<double>(points_when_grown_));
  if (!forest_ || change > kMostChange * static_cast<double>(points_when_grown_)) {
    forest_.emplace(scaled, IsolationForestOptions{});
    points_when_grown_ = scaled.size();
  }
  return forest_->Scores(scaled);
}

std::vector<bool> ObjectShape::JudgePoints(std::span<const Eigen::Vector3d> points_world) {
  if (config_.outlier_removal == "none") return std::vector<bool>(points_world.size(), true);
  const bool use_hull = config_.outlier_removal == "hull_and_forest";
  std::vector<Eigen::Vector3d> inside;
  std::vector<size_t> inside_index;
  for (size_t i = 0; i < points_world.size(); ++i) {
    const Eigen::Vector3d p_grid = hull_.region().ToGrid(points_world[i]);
    if (use_hull && !hull_.Contains(p_grid, LenientVotes())) continue;
    inside.push_back(p_grid);
    inside_index.push_back(i);
  }
  constexpr double kLonelyScore = 0.65;
  const std::vector<double> scores = Loneliness(inside);
  std::vector<bool> is_inlier(points_world.size(), false);
  for (size_t i = 0; i < inside.size(); ++i) is_inlier[inside_index[i]] = scores[i] < kLonelyScore;
  return is_inlier;
}

std::vector<Eigen::Vector3d> ObjectShape::SampleBody(const Cuboid& cuboid, std::span<const Eigen::Vector3d> cells_grid,
                                                     std::span<const Eigen::Vector3d> points_world,
                                                     const std::vector<bool>& is_inlier) const {
  constexpr size_t kSamplesPerSource = 60;
  const SE3<Object, World> T_object_world = cuboid.T_world_object.Inverse();
  const Eigen::Matrix3d R_object_grid = T_object_world.RotationMatrix() * hull_.region().R_world_grid;
  const Eigen::Vector3d offset = T_object_world * hull_.region().center_world;
  std::vector<Eigen::Vector3d> cells;
  for (const Eigen::Vector3d& cell : cells_grid) {
    const Eigen::Vector3d p_object = R_object_grid * cell + offset;
    if ((p_object.cwiseAbs().array() <= cuboid.half_extents.array()).all()) cells.push_back(cell);
  }
  std::vector<Eigen::Vector3d> inliers;
  for (size_t i = 0; i < points_world.size(); ++i) {
    if (is_inlier[i]) inliers.push_back(points_world[i]);
  }
  std::vector<Eigen::Vector3d> body;
  const size_t cell_count = std::min(kSamplesPerSource, cells.size());
  for (size_t i = 0; i < cell_count; ++i) {
    body.push_back(hull_.region().ToWorld(cells[i * cells.size() / cell_count]));
  }
  const size_t point_count = std::min(kSamplesPerSource, inliers.size());
  for (size_t i = 0; i < point_count; ++i) body.push_back(inliers[i * inliers.size() / point_count]);
  return body;
}

std::optional<ObjectShape::Fit> ObjectShape::Update(const Surroundings& surroundings,
                                                    const std::optional<Cuboid>& previous) {
  const auto extent = EstimateExtent(surroundings);
  if (!extent) return std::nullopt;
  const auto start_over = [&] {
    Carve({RotationFromZTo(surroundings.up_world).toRotationMatrix(), extent->center_world,
           Eigen::Vector3d::Constant(0.85 * extent->size_mu)},
          surroundings);
  };
  news_ = 0;
  if (hull_.empty()) start_over();
  VoteForNews();
  StraightenRegion(surroundings);
  RefocusRegion(*extent, surroundings);

  CuboidEvidence evidence;
  evidence.region = hull_.region();
  evidence.hull_cells = hull_.Cells(StrictVotes());
  if (evidence.hull_cells.empty()) evidence.hull_cells = hull_.Cells(LenientVotes());
  if (evidence.hull_cells.empty()) {
    spdlog::debug("objects: no space is left by {} silhouettes, carving anew", silhouettes_.size());
    start_over();
    return std::nullopt;
  }
  Fit fit;
  fit.point_is_inlier = JudgePoints(surroundings.points);
  evidence.cell_size = hull_.CellSize();
  for (size_t i = 0; i < surroundings.points.size(); ++i) {
    if (fit.point_is_inlier[i]) evidence.points.push_back(evidence.region.ToGrid(surroundings.points[i]));
  }
  for (const Eigen::Vector3d& p : surroundings.background) {
    if ((p - extent->center_world).norm() < 2 * extent->size_mu)
      evidence.background.push_back(evidence.region.ToGrid(p));
  }
  const double center_height = surroundings.up_world.dot(evidence.region.center_world);
  for (const auto& [key, cuboid] : *surroundings.neighbours) {
    const double bottom = surroundings.up_world.dot(cuboid.T_world_object.translation()) - cuboid.half_extents.z();
    evidence.neighbour_bottoms.push_back(bottom - center_height);
    const Eigen::Vector3d center = cuboid.T_world_object.Inverse() * extent->center_world;
    const bool is_below = (center.head<2>().cwiseAbs().array() <= cuboid.half_extents.head<2>().array()).all();
    if (is_below) evidence.carrier_tops.push_back(evidence.neighbour_bottoms.back() + 2 * cuboid.half_extents.z());
  }
  evidence.center = evidence.region.ToGrid(extent->center_world);
  const auto edge_yaw = EdgeYaw(silhouettes_, evidence.region.R_world_grid);
  edge_yaw_confidence_ = edge_yaw ? edge_yaw->confidence : 0;
  if (edge_yaw_confidence_ > config_.edge_yaw_min_confidence) evidence.edge_yaw_rad = edge_yaw->yaw_rad;
  evidence.object_size_mu = extent->size_mu;
  evidence.min_points = config_.min_object_points;
  const auto fitted =
      config_.cuboid_from == "points" ? FitToPoints(evidence) : FitCuboid(evidence, silhouettes_, previous);
  if (!fitted) return std::nullopt;
  const Cuboid* cuboid = &fitted->cuboid;
  fit.cuboid = fitted->cuboid;
  fit.reach = fitted->reach;
  fit.body_world = SampleBody(*cuboid, evidence.hull_cells, surroundings.points, fit.point_is_inlier);
  fit.parallax_rad = ParallaxRad(silhouettes_, cuboid->T_world_object.translation());
  const double seen_around = std::min(1.0, fit.parallax_rad / (60 * kRadPerDeg));
  const double seen_often = std::min(1.0, static_cast<double>(silhouettes_.size()) / 10);
  const double known_points = std::min(1.0, static_cast<double>(evidence.points.size()) / 50);
  fit.cuboid.confidence = cuboid->confidence * (0.4 * seen_around + 0.3 * seen_often + 0.3 * known_points);
  return fit;
}

}  // namespace romap::objects
