#include "server/objects/box_search.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace romap::objects {
namespace {

// Cost per map unit by which an outline falls short of a mask or extends beyond it. With these weights a face is
// optimal if it covers 19 of 20 masks.
constexpr float kFallShortWeight = 0.95F;
constexpr float kReachFartherWeight = 1 - kFallShortWeight;
// A corner that extends beyond the mask by more than this share of the object's size is treated as not filled by the
// object. Its cost is bounded, otherwise boxes of round objects would be too small.
constexpr float kFilledCornerShare = 0.07F;
// Largest cost of one silhouette, in terms of the object's size.
constexpr float kMaxSilhouetteCost = 0.3F;
// Weights per silhouette, relative to one direction of a mask, of the box's extents, of the mean distance of points
// outside the box, of the distance of the bottom from the support, and of the distance of each face from its previous
// position. Height costs more than width: seen from above and from one side only, a top that is higher by some amount
// covers as much of the image as a far side that is farther by about twice that amount, so that the box would grow tall
// rather than deep.
constexpr double kExtentWeight = 0.04;
constexpr double kHeightWeight = 0.08;
constexpr double kPointsWeight = 3;
constexpr double kSupportWeight = 2;
constexpr double kPreviousWeight = 0.02;
// Largest cost of one point outside the box, in terms of the object's size: the point may be an outlier.
constexpr double kOutlierShare = 0.02;
constexpr size_t kMaxPoints = 120;  // more points are subsampled to limit the run time

}  // namespace

BoxSearch::BoxSearch(const BoxCriteria& criteria, const std::vector<Silhouette>& silhouettes, double yaw_rad)
    : criteria_(criteria), yaw_rad_(yaw_rad) {
  for (size_t k = 0; k < kHalf; ++k) directions_[k] = ExtentDirection(static_cast<int>(k)).cast<float>();
  criteria_.points.clear();
  const Eigen::Rotation2Dd to_box(-yaw_rad);
  const size_t count = std::min(kMaxPoints, criteria.points.size());
  for (size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d& p = criteria.points[i * criteria.points.size() / count];
    const Eigen::Vector2d xy = to_box * p.head<2>();
    criteria_.points.emplace_back(xy.x(), xy.y(), p.z());
  }
  targets_.reserve(silhouettes.size());
  for (const Silhouette& silhouette : silhouettes) AddTarget(silhouette);
}

void BoxSearch::AddTarget(const Silhouette& silhouette) {
  const HullRegion& region = criteria_.region;
  const Eigen::Matrix3d M = silhouette.P_image_world.leftCols<3>();
  Eigen::Matrix<double, 3, 4> P;
  P << M * region.R_world_grid, M * region.center_world + silhouette.P_image_world.col(3);
  P.topRows<2>() *= silhouette.masks->stride_px;
  const Eigen::Vector3d q = P * criteria_.center.homogeneous();
  if (!(q.z() > 0)) return;
  const Eigen::Vector2d origin_px = q.hnormalized();
  const double mu_per_px = q.z() / silhouette.camera.fx_px;
  P.row(0) = (P.row(0) - origin_px.x() * P.row(2)) * mu_per_px;
  P.row(1) = (P.row(1) - origin_px.y() * P.row(2)) * mu_per_px;
  P.leftCols<2>() *= Eigen::Rotation2Dd(yaw_rad_).toRotationMatrix();
  Target target{.P = P.cast<float>(), .reach_mu = {}, .is_free = {}};
  const Eigen::Vector3d center_world = region.ToWorld(criteria_.center);
  for (size_t k = 0; k < kExtentDirections; ++k) {
    const auto direction = static_cast<int>(k);
    const double reach_px = silhouette.extents.reach_px[k] - ExtentDirection(direction).dot(origin_px);
    target.reach_mu[k] = static_cast<float>(reach_px * mu_per_px);
    target.is_free[k] = silhouette.IsFreeExtent(direction, center_world);
  }
  targets_.push_back(target);
}

BoxSearch::Reaches BoxSearch::OutlineOf(const UprightBox& box, const Target& target) const {
  using Corners = Eigen::Array<float, 8, 1>;
  const Eigen::Vector3f low = box.low.cast<float>();
  const Eigen::Vector3f high = box.high.cast<float>();
  const Corners x{low.x(), high.x(), low.x(), high.x(), low.x(), high.x(), low.x(), high.x()};
  const Corners y{low.y(), low.y(), high.y(), high.y(), low.y(), low.y(), high.y(), high.y()};
  const Corners z{low.z(), low.z(), low.z(), low.z(), high.z(), high.z(), high.z(), high.z()};
  const auto& P = target.P;
  // The minimum moves a corner behind the camera far outside the image.
  const Corners depth = (P(2, 0) * x + P(2, 1) * y + P(2, 2) * z + P(2, 3)).max(1e-6F);
  const Corners u = (P(0, 0) * x + P(0, 1) * y + P(0, 2) * z + P(0, 3)) / depth;
  const Corners v = (P(1, 0) * x + P(1, 1) * y + P(1, 2) * z + P(1, 3)) / depth;
  Reaches reaches;
  for (size_t k = 0; k < kHalf; ++k) {
    const Corners along = directions_[k].x() * u + directions_[k].y() * v;
    reaches[k] = along.maxCoeff();
    reaches[k + kHalf] = -along.minCoeff();
  }
  return reaches;
}

float BoxSearch::SilhouetteCost(const UprightBox& box, const Target& target) const {
  const Reaches outline = OutlineOf(box, target);
  const auto size_mu = static_cast<float>(criteria_.object_size_mu);
  const float filled_mu = kFilledCornerShare * size_mu;
  float cost = 0;
  for (size_t k = 0; k < kExtentDirections; ++k) {
    const float farther = outline[k] - target.reach_mu[k];
    if (farther < 0) {
      cost -= kFallShortWeight * farther;
    } else if (target.is_free[k]) {
      cost += kReachFartherWeight * farther * filled_mu / (filled_mu + farther);
    }
  }
  return std::min(cost, kMaxSilhouetteCost * size_mu);
}

double BoxSearch::PriorCost(const UprightBox& box) const {
  const Eigen::Vector3d extents = box.high - box.low;
  double cost = kExtentWeight * (extents.x() + extents.y()) + kHeightWeight * extents.z();
  double outside = 0;
  for (const Eigen::Vector3d& p : criteria_.points) {
    const double distance = (box.low - p).cwiseMax(p - box.high).maxCoeff();
    outside += std::clamp(distance, 0.0, kOutlierShare * criteria_.object_size_mu);
  }
  if (outside > 0) cost += kPointsWeight * outside / static_cast<double>(criteria_.points.size());
  if (criteria_.support_height) cost += kSupportWeight * std::abs(box.low.z() - *criteria_.support_height);
  if (criteria_.bottom_bound) cost += kSupportWeight * std::max(0.0, box.low.z() - *criteria_.bottom_bound);
  if (const auto& previous = criteria_.previous) {
    cost += kPreviousWeight * ((box.low - previous->low).lpNorm<1>() + (box.high - previous->high).lpNorm<1>());
  }
  return cost * static_cast<double>(targets_.size());
}

double BoxSearch::Cost(const UprightBox& box) const {
  double cost = PriorCost(box);
  for (const Target& target : targets_) cost += static_cast<double>(SilhouetteCost(box, target));
  return cost;
}

bool BoxSearch::TryMove(int axis, double low_step, double high_step, UprightBox* box, double* cost) const {
  UprightBox moved = *box;
  moved.low[axis] += low_step;
  moved.high[axis] += high_step;
  constexpr double kMinExtent = 1e-3;  // of the object's size
  if (!(moved.high[axis] - moved.low[axis] > kMinExtent * criteria_.object_size_mu)) return false;
  const double moved_cost = Cost(moved);
  if (moved_cost >= *cost) return false;
  *box = moved;
  *cost = moved_cost;
  return true;
}

UprightBox BoxSearch::Refine(const UprightBox& start, double step_mu) const {
  constexpr double kMinStepShare = 0.004;  // of the object's size
  constexpr double kMinGain = 1e-3;        // share of the cost, per round of moves; below it the step is halved
  UprightBox box = start;
  double cost = Cost(box);
  for (double step = step_mu; step > kMinStepShare * criteria_.object_size_mu;) {
    const double cost_before = cost;
    for (int axis = 0; axis < 3; ++axis) {
      if (!TryMove(axis, step, 0, &box, &cost)) TryMove(axis, -step, 0, &box, &cost);
      if (!TryMove(axis, 0, -step, &box, &cost)) TryMove(axis, 0, step, &box, &cost);
      if (!TryMove(axis, step, step, &box, &cost)) TryMove(axis, -step, -step, &box, &cost);
    }
    if (cost > (1 - kMinGain) * cost_before) step /= 2;
  }
  return box;
}

double BoxSearch::Agreement(const UprightBox& box) const {
  constexpr float kGoodShare = 0.05F;  // of the object's size
  constexpr int kMaxShort = 2;         // directions in which a covering box may fall short
  if (targets_.empty()) return 0;
  const float tolerance_mu = kGoodShare * static_cast<float>(criteria_.object_size_mu);
  const auto agreeing = std::count_if(targets_.begin(), targets_.end(), [&](const Target& target) {
    const Reaches outline = OutlineOf(box, target);
    int fall_short = 0;
    for (size_t k = 0; k < kExtentDirections; ++k) fall_short += target.reach_mu[k] - outline[k] > tolerance_mu ? 1 : 0;
    return fall_short <= kMaxShort;
  });
  return static_cast<double>(agreeing) / static_cast<double>(targets_.size());
}

double BoxSearch::Looseness(const UprightBox& box) const {
  float sum = 0;
  int count = 0;
  for (const Target& target : targets_) {
    const Reaches outline = OutlineOf(box, target);
    for (size_t k = 0; k < kExtentDirections; ++k) {
      if (!target.is_free[k]) continue;
      sum += std::max(0.0F, outline[k] - target.reach_mu[k]);
      ++count;
    }
  }
  return count > 0 ? static_cast<double>(sum) / (count * criteria_.object_size_mu) : 0;
}

}  // namespace romap::objects
