#include "server/objects/object_shape.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/angles.h"
#include "common/statistics.h"
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
  return CuboidFit{.cuboid = *cuboid, .training_box = *cuboid};
}

// Ray through the middle of the mask's box. It does not depend on the object's center and is accurate enough to compare
// cameras.
Eigen::Vector3d ViewDirection(const Silhouette& silhouette) {
  const double u_px = silhouette.box_px.x + silhouette.box_px.width / 2.0;
  const double v_px = silhouette.box_px.y + silhouette.box_px.height / 2.0;
  return silhouette.T_world_camera.rotation() * silhouette.camera.Unproject(u_px, v_px);
}

// Minimum number of silhouettes that must contain a cell. The cell may be occluded or outside the image in the others.
int MinInside(int silhouettes) { return std::max(1, silhouettes * 3 / 10); }

// A few wrong masks must not remove part of the object, but every tolerated wrong silhouette makes the hull wider.
hull::CarvingRule StrictRule(size_t silhouettes) {
  constexpr int kMinToTolerateErrors = 8;   // silhouettes; with fewer, tolerating an error makes the hull too wide
  constexpr int kSilhouettesPerError = 20;  // one of this many silhouettes may be wrong
  const auto count = static_cast<int>(silhouettes);
  return {.min_background = count < kMinToTolerateErrors ? 1 : 1 + std::max(1, count / kSilhouettesPerError),
          .min_object = MinInside(count)};
}

hull::CarvingRule LenientRule(size_t silhouettes) {
  constexpr int kSilhouettesPerError = 4;
  const auto count = static_cast<int>(silhouettes);
  return {.min_background = 1 + std::max(1, count / kSilhouettesPerError), .min_object = MinInside(count)};
}

// Confidence, 0..1, that the evidence determines a cuboid.
double EvidenceConfidence(double parallax_rad, size_t silhouettes, size_t points) {
  constexpr double kFullParallaxRad = 60 * kRadPerDeg;
  constexpr double kFullSilhouettes = 10;
  constexpr double kFullPoints = 50;
  const double by_parallax = std::min(1.0, parallax_rad / kFullParallaxRad);
  const double by_silhouettes = std::min(1.0, static_cast<double>(silhouettes) / kFullSilhouettes);
  const double by_points = std::min(1.0, static_cast<double>(points) / kFullPoints);
  return 0.4 * by_parallax + 0.3 * by_silhouettes + 0.3 * by_points;
}

}  // namespace

bool ObjectShape::IsRedundant(const Silhouette& silhouette) const {
  const double limit = config_.silhouette_angle_deg * kRadPerDeg;
  const Eigen::Vector3d direction = ViewDirection(silhouette);
  return std::any_of(silhouettes_.begin(), silhouettes_.end(), [&](const Silhouette& other) {
    return other.cut_by_border <= silhouette.cut_by_border && AngleBetween(ViewDirection(other), direction) < limit;
  });
}

bool ObjectShape::NeedsSegments(const Silhouette& silhouette) const {
  constexpr double kCertainConfidence = 0.5;  // of the yaw, see YawEstimate
  constexpr size_t kCertainViews = 8;
  constexpr double kAngleFactor = 1.5;  // edges need fewer directions than silhouettes
  if (edge_yaw_confidence_ > kCertainConfidence && SegmentViews() >= kCertainViews) return false;
  const double limit = kAngleFactor * config_.silhouette_angle_deg * kRadPerDeg;
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
  ++changed_silhouettes_;
  if (silhouettes_.size() > static_cast<size_t>(config_.max_silhouettes)) DropMostRedundant();
  return true;
}

// Drops one of the two silhouettes with the most similar directions: the earlier one if it is cut off, otherwise the
// later one.
void ObjectShape::DropMostRedundant() {
  std::vector<Eigen::Vector3d> directions;
  for (const Silhouette& silhouette : silhouettes_) directions.push_back(ViewDirection(silhouette).normalized());
  size_t dropped = 0;
  double highest_cosine = -2;
  for (size_t i = 0; i < directions.size(); ++i) {
    for (size_t j = i + 1; j < directions.size(); ++j) {
      const double cosine = directions[i].dot(directions[j]);
      if (cosine <= highest_cosine) continue;
      highest_cosine = cosine;
      dropped = silhouettes_[i].cut_by_border ? i : j;
    }
  }
  RemoveVote(dropped);
  silhouettes_.erase(silhouettes_.begin() + static_cast<std::ptrdiff_t>(dropped));
  has_voted_.erase(has_voted_.begin() + static_cast<std::ptrdiff_t>(dropped));
}

void ObjectShape::RemoveVote(size_t i) {
  if (has_voted_[i]) hull_.Remove(silhouettes_[i]);
  has_voted_[i] = false;
}

void ObjectShape::AddMissingVotes() {
  for (size_t i = 0; i < silhouettes_.size(); ++i) {
    if (!has_voted_[i]) hull_.Add(silhouettes_[i]);
    has_voted_[i] = true;
  }
}

bool ObjectShape::Correct(const Sim3<World, World>& S_new_old, const KeyframeCorrections& keyframes,
                          const std::optional<Cuboid>& cuboid) {
  constexpr double kMinShift_px = 0.5;  // masks are less accurate
  bool changed = false;
  hull_.Move(S_new_old);
  for (size_t i = 0; i < silhouettes_.size(); ++i) {
    Silhouette& silhouette = silhouettes_[i];
    Move(S_new_old, &silhouette);
    const auto corrected = keyframes.find(silhouette.keyframe);
    if (corrected != keyframes.end()) silhouette.corrected_T_world_camera = corrected->second.T_world_camera;
    if (cuboid && LargestShift_px(*cuboid, silhouette.camera, silhouette.T_world_camera,
                                  silhouette.corrected_T_world_camera) < kMinShift_px) {
      continue;
    }
    RemoveVote(i);
    ApplyCorrectedPose(&silhouette);
    ++changed_silhouettes_;
    changed = true;
  }
  return changed;
}

std::optional<ObjectShape::Extent> ObjectShape::EstimateExtent(const Surroundings& surroundings) const {
  constexpr double kGoodParallaxRad = 15 * kRadPerDeg;  // with less, map points locate the object better than masks
  constexpr double kMinParallaxRad = 5 * kRadPerDeg;
  const auto ray_center = IntersectCenterRays(silhouettes_, kMinParallaxRad);
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

// Carves the hull from scratch, with the newest cuboids of the neighbors in the silhouettes.
void ObjectShape::Carve(const HullRegion& region, const Surroundings& surroundings) {
  constexpr int kHullCells = 20;  // along each side of the grid
  hull_.Reset(region, kHullCells);
  forest_.reset();
  silhouettes_when_carved_ = silhouettes_.size();
  for (Silhouette& silhouette : silhouettes_) UpdateNeighbors(*surroundings.neighbors, &silhouette);
  has_voted_.assign(silhouettes_.size(), false);
  AddMissingVotes();
}

// Map corrections tilt the grid with its object, but a fit requires an upright grid.
void ObjectShape::MakeRegionUpright(const Surroundings& surroundings) {
  constexpr double kMaxTiltRad = 0.3 * kRadPerDeg;
  HullRegion region = hull_.region();
  const Eigen::Vector3d z = region.R_world_grid.col(2);
  if (AngleBetween(z, surroundings.up_world) < kMaxTiltRad) return;
  region.R_world_grid = ShortestRotation(z, surroundings.up_world) * region.R_world_grid;
  Carve(region, surroundings);
}

// Moves the grid to the hull when the hull reaches the grid's border, or when many silhouettes were added since it was
// carved: then the hull fills only a small part of the grid.
void ObjectShape::FitRegionToHull(const Extent& extent, const Surroundings& surroundings) {
  constexpr double kMaxHalfExtent = 1.3;    // of the grid, in terms of the object's size
  constexpr double kBorder = 0.97;          // share of the grid's half extent; a hull beyond it touches the border
  constexpr double kGrowthAtBorder = 1.6;   // of the hull's half extent, where it is cut off
  constexpr double kGrowth = 1.25;          // of the hull's half extent elsewhere
  constexpr double kManySilhouettes = 2.0;  // relative to the number when the hull was carved
  constexpr double kAtMaximum = 0.99;       // share of the largest half extent above which the grid cannot grow
  const Eigen::AlignedBox3d hull = hull_.Bounds(StrictRule(silhouettes_.size()));
  if (hull.isEmpty()) return;
  const Eigen::Vector3d& low = hull.min();
  const Eigen::Vector3d& high = hull.max();
  const HullRegion& region = hull_.region();
  const Eigen::Vector3d extent_share = high.cwiseMax(-low).cwiseQuotient(region.half_extents);
  const double max_mu = kMaxHalfExtent * extent.size_mu;
  const bool may_grow = (region.half_extents.array() < kAtMaximum * max_mu).any() && extent_share.maxCoeff() > kBorder;
  const bool many_added = silhouettes_.size() > kManySilhouettes * static_cast<double>(silhouettes_when_carved_);
  const bool any_added = silhouettes_.size() != silhouettes_when_carved_;
  if (!many_added && !(may_grow && any_added)) return;
  HullRegion next = region;
  next.center_world = region.ToWorld((low + high) / 2);
  for (int axis = 0; axis < 3; ++axis) {
    const double growth = extent_share[axis] > kBorder ? kGrowthAtBorder : kGrowth;
    next.half_extents[axis] = std::min(max_mu, growth * (high[axis] - low[axis]) / 2);
  }
  Carve(next, surroundings);
}

// Growing the forest takes longer than evaluating it, so it is reused while the number of points is about the same.
std::vector<double> ObjectShape::AnomalyScores(const std::vector<Eigen::Vector3d>& points_grid) {
  constexpr size_t kMinPoints = 4;
  constexpr double kMaxChange = 0.1;  // of the number of points
  if (points_grid.size() < kMinPoints) return std::vector<double>(points_grid.size(), 0.5);
  std::vector<Eigen::Vector3d> scaled;
  for (const Eigen::Vector3d& p : points_grid) scaled.emplace_back(p / hull_.region().half_extents.x());
  const double change = std::abs(static_cast<double>(scaled.size()) - static_cast<double>(points_when_grown_));
  if (!forest_ || change > kMaxChange * static_cast<double>(points_when_grown_)) {
    forest_.emplace(scaled, IsolationForestOptions{});
    points_when_grown_ = scaled.size();
  }
  return forest_->Scores(scaled);
}

std::vector<bool> ObjectShape::FindInliers(std::span<const Eigen::Vector3d> points_world) {
  if (config_.outlier_removal == "none") return std::vector<bool>(points_world.size(), true);
  const bool use_hull = config_.outlier_removal == "hull_and_forest";
  std::vector<Eigen::Vector3d> inside;
  std::vector<size_t> inside_index;
  for (size_t i = 0; i < points_world.size(); ++i) {
    const Eigen::Vector3d p_grid = hull_.region().ToGrid(points_world[i]);
    if (use_hull && !hull_.Contains(p_grid, LenientRule(silhouettes_.size()))) continue;
    inside.push_back(p_grid);
    inside_index.push_back(i);
  }
  // Threshold of the anomaly score, 0..1. Higher than the usual 0.6, because a cuboid needs its outermost points.
  constexpr double kOutlierScore = 0.65;
  const std::vector<double> scores = AnomalyScores(inside);
  std::vector<bool> is_inlier(points_world.size(), false);
  for (size_t i = 0; i < inside.size(); ++i) is_inlier[inside_index[i]] = scores[i] < kOutlierScore;
  return is_inlier;
}

// Some hull cells and map points inside the cuboid, spread evenly over both lists.
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

CuboidEvidence ObjectShape::CollectEvidence(const Extent& extent, const Surroundings& surroundings,
                                            std::vector<Eigen::Vector3d> hull_cells,
                                            const std::vector<bool>& point_is_inlier) {
  constexpr double kBackgroundRadius = 2;  // in terms of the object's size
  CuboidEvidence evidence;
  evidence.region = hull_.region();
  evidence.hull_cells = std::move(hull_cells);
  evidence.cell_size = hull_.CellSize();
  for (size_t i = 0; i < surroundings.points.size(); ++i) {
    if (point_is_inlier[i]) evidence.points.push_back(evidence.region.ToGrid(surroundings.points[i]));
  }
  for (const Eigen::Vector3d& p : surroundings.background) {
    if ((p - extent.center_world).norm() < kBackgroundRadius * extent.size_mu) {
      evidence.background.push_back(evidence.region.ToGrid(p));
    }
  }
  const double center_height = surroundings.up_world.dot(evidence.region.center_world);
  for (const auto& [key, cuboid] : *surroundings.neighbors) {
    const double bottom = surroundings.up_world.dot(cuboid.T_world_object.translation()) - cuboid.half_extents.z();
    evidence.neighbor_bottoms.push_back(bottom - center_height);
    const Eigen::Vector3d center = cuboid.T_world_object.Inverse() * extent.center_world;
    const bool is_below = (center.head<2>().cwiseAbs().array() <= cuboid.half_extents.head<2>().array()).all();
    if (is_below) evidence.supporting_tops.push_back(evidence.neighbor_bottoms.back() + 2 * cuboid.half_extents.z());
  }
  evidence.center = evidence.region.ToGrid(extent.center_world);
  const auto edge_yaw = EdgeYaw(silhouettes_, evidence.region.R_world_grid);
  edge_yaw_confidence_ = edge_yaw ? edge_yaw->confidence : 0;
  if (edge_yaw_confidence_ > config_.edge_yaw_min_confidence) evidence.edge_yaw_rad = edge_yaw->yaw_rad;
  evidence.object_size_mu = extent.size_mu;
  evidence.min_points = config_.min_object_points;
  return evidence;
}

std::optional<ObjectShape::Fit> ObjectShape::Update(const Surroundings& surroundings,
                                                    const std::optional<Cuboid>& previous) {
  const auto extent = EstimateExtent(surroundings);
  if (!extent) return std::nullopt;
  constexpr double kFirstHalfExtent = 0.85;  // of the grid, in terms of the object's size
  const auto carve_from_scratch = [&] {
    Carve({RotationFromZTo(surroundings.up_world).toRotationMatrix(), extent->center_world,
           Eigen::Vector3d::Constant(kFirstHalfExtent * extent->size_mu)},
          surroundings);
  };
  changed_silhouettes_ = 0;
  if (hull_.empty()) carve_from_scratch();
  AddMissingVotes();
  MakeRegionUpright(surroundings);
  FitRegionToHull(*extent, surroundings);
  std::vector<Eigen::Vector3d> hull_cells = hull_.Cells(StrictRule(silhouettes_.size()));
  if (hull_cells.empty()) hull_cells = hull_.Cells(LenientRule(silhouettes_.size()));
  if (hull_cells.empty()) {
    spdlog::debug("objects: the visual hull of {} silhouettes is empty; carving from scratch", silhouettes_.size());
    carve_from_scratch();
    return std::nullopt;
  }
  Fit fit;
  fit.point_is_inlier = FindInliers(surroundings.points);
  const CuboidEvidence evidence = CollectEvidence(*extent, surroundings, std::move(hull_cells), fit.point_is_inlier);
  const auto fitted =
      config_.cuboid_from == "points" ? FitToPoints(evidence) : FitCuboid(evidence, silhouettes_, previous);
  if (!fitted) return std::nullopt;
  fit.cuboid = fitted->cuboid;
  fit.training_box = fitted->training_box;
  fit.body_world = SampleBody(fitted->cuboid, evidence.hull_cells, surroundings.points, fit.point_is_inlier);
  fit.parallax_rad = ParallaxRad(silhouettes_, fitted->cuboid.T_world_object.translation());
  fit.cuboid.confidence *= EvidenceConfidence(fit.parallax_rad, silhouettes_.size(), evidence.points.size());
  return fit;
}

}  // namespace romap::objects
