#include "server/objects/mask_base.h"

#include <algorithm>
#include <cmath>

#include "common/statistics.h"

namespace romap::objects {
namespace {

constexpr size_t kMinViews = 3;
// Rays through pixels on the border of a mask would miss the subsampled masks of the other views.
constexpr double kInset_strides = 0.75;
// Seen from straight above, the lowest pixel of a mask shows no lower end.
constexpr double kMinLevel = 0.2;  // horizontal part of a ray's unit direction
constexpr int kSteps = 64;         // along a ray, over twice the object's size
constexpr int kBisections = 5;
// Distance of a second ray above the first one, in terms of the object's size, from which the slope follows.
constexpr double kSlopeBase = 0.04;
// Every bound holds on its own, but a wrong mask makes it wrong, so not the lowest one is used.
constexpr double kShareOfBounds = 0.25;  // quantile
// As in the hull of an object: one of this many masks may be wrong.
constexpr int kMasksPerError = 20;

// The extent direction of the mask that points down at the object.
int DownwardDirection(const Silhouette& silhouette, const Eigen::Vector3d& center_world,
                      const Eigen::Vector3d& up_world, double step_mu) {
  const auto to_pixel = [&](const Eigen::Vector3d& p) {
    const Eigen::Vector3d q = silhouette.P_image_world * p.homogeneous();
    return Eigen::Vector2d(q.hnormalized());
  };
  const Eigen::Vector2d down_px = to_pixel(center_world - step_mu * up_world) - to_pixel(center_world);
  int best = 0;
  for (int k = 1; k < kExtentDirections; ++k) {
    if (ExtentDirection(k).dot(down_px) > ExtentDirection(best).dot(down_px)) best = k;
  }
  return best;
}

// Finds the highest point of a ray that enough masks allow to be part of the object.
class RayBound {
 public:
  explicit RayBound(const std::vector<Silhouette>& silhouettes)
      : silhouettes_(silhouettes), max_contradictions_(static_cast<int>(silhouettes.size()) / kMasksPerError) {}

  // The highest allowed point along `up_world` between the distances `near_mu` and `far_mu`.
  std::optional<Eigen::Vector3d> HighestAllowed(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                                const Eigen::Vector3d& up_world, double near_mu, double far_mu) const {
    const double step_mu = (far_mu - near_mu) / kSteps;
    const bool descends = up_world.dot(direction) < 0;
    for (int i = 0; i <= kSteps; ++i) {
      double inside_mu = descends ? near_mu + i * step_mu : far_mu - i * step_mu;
      if (!IsAllowed(origin + inside_mu * direction)) continue;
      double outside_mu = inside_mu + (descends ? -step_mu : step_mu);
      for (int k = 0; k < kBisections && i > 0; ++k) {
        const double middle_mu = (inside_mu + outside_mu) / 2;
        (IsAllowed(origin + middle_mu * direction) ? inside_mu : outside_mu) = middle_mu;
      }
      return origin + inside_mu * direction;
    }
    return std::nullopt;
  }

 private:
  bool IsAllowed(const Eigen::Vector3d& p_world) const {
    int contradictions = 0;
    for (const Silhouette& silhouette : silhouettes_) {
      const int mask = silhouette.IndexAt(silhouette.P_image_world * p_world.homogeneous());
      if (mask < 0 || mask == silhouette.index || (mask > 0 && silhouette.MayOcclude(mask, p_world))) continue;
      if (++contradictions > max_contradictions_) return false;
    }
    return true;
  }

  const std::vector<Silhouette>& silhouettes_;
  int max_contradictions_;
};

// The lower end of one mask.
struct LowerEnd {
  Eigen::Vector3d contact_world = Eigen::Vector3d::Zero();  // where the ray through it meets the object at the latest
  double height = 0;                                        // of that point, without the inset of the ray
  // Rise of the surface from this ray to one slightly above it, relative to that of an upright wall. Of a ball, it is
  // about 2.
  double steepness = 1;
  // Height of a ball's tangent point above the ball's bottom, in terms of its distance from the axis.
  double ball_drop = 0;
};

class LowerEnds {
 public:
  LowerEnds(const HullRegion& region, const Eigen::Vector3d& center, double object_size_mu,
            const std::vector<Silhouette>& silhouettes)
      : up_world_(region.R_world_grid.col(2)),
        center_world_(region.ToWorld(center)),
        object_size_mu_(object_size_mu),
        bound_(silhouettes) {}

  std::optional<LowerEnd> Of(const Silhouette& silhouette) const {
    const double depth_mu = (silhouette.T_world_camera.Inverse() * center_world_).z();
    if (!(depth_mu > 0) || !((center_world_ - silhouette.CameraCenter()).norm() > object_size_mu_)) return std::nullopt;
    const int down = DownwardDirection(silhouette, center_world_, up_world_, 0.1 * object_size_mu_);
    if (!silhouette.IsFreeExtent(down, center_world_)) return std::nullopt;
    const double mu_per_px = depth_mu / silhouette.camera.fy_px;
    const double inset_px = kInset_strides * silhouette.masks->stride_px;
    const double slope_px = std::max(kSlopeBase * object_size_mu_ / mu_per_px, 2.0 * silhouette.masks->stride_px);
    const auto low = Meet(silhouette, down, inset_px);
    const auto above = Meet(silhouette, down, inset_px + slope_px);
    if (!low) return std::nullopt;
    const Eigen::Vector3d direction = (*low - silhouette.CameraCenter()).normalized();
    const double level = up_world_.cross(direction).norm();
    if (level < kMinLevel) return std::nullopt;
    LowerEnd end{.contact_world = *low, .height = up_world_.dot(*low) - inset_px * mu_per_px / level};
    end.ball_drop = (1 - level) / std::max(std::abs(up_world_.dot(direction)), 1e-3);
    if (above) end.steepness = up_world_.dot(*above - *low) * level / (slope_px * mu_per_px);
    return end;
  }

  const Eigen::Vector3d& up_world() const { return up_world_; }

 private:
  std::optional<Eigen::Vector3d> Meet(const Silhouette& silhouette, int down, double inset_px) const {
    const Eigen::Vector2d pixel_px =
        silhouette.extents.tip_px[static_cast<size_t>(down)].cast<double>() - inset_px * ExtentDirection(down);
    const Eigen::Vector3d direction =
        (silhouette.T_world_camera.rotation() * silhouette.camera.Unproject(pixel_px.x(), pixel_px.y())).normalized();
    const double distance_mu = (center_world_ - silhouette.CameraCenter()).norm();
    return bound_.HighestAllowed(silhouette.CameraCenter(), direction, up_world_, distance_mu - object_size_mu_,
                                 distance_mu + object_size_mu_);
  }

  Eigen::Vector3d up_world_;
  Eigen::Vector3d center_world_;
  double object_size_mu_;
  RayBound bound_;
};

// 0 for walls, 1 for a ball.
double Bulge(double steepness) {
  constexpr double kWall = 1.35;  // walls of pots are inclined
  constexpr double kBall = 1.9;
  return std::clamp((steepness - kWall) / (kBall - kWall), 0.0, 1.0);
}

}  // namespace

std::optional<MaskBase> FindMaskBase(const HullRegion& region, const Eigen::Vector3d& center, double object_size_mu,
                                     const std::vector<Silhouette>& silhouettes) {
  const LowerEnds ends(region, center, object_size_mu, silhouettes);
  std::vector<LowerEnd> found;
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();
  for (const Silhouette& silhouette : silhouettes) {
    const auto end = ends.Of(silhouette);
    if (!end) continue;
    found.push_back(*end);
    axis += end->contact_world;
  }
  if (found.size() < kMinViews) return std::nullopt;
  axis /= static_cast<double>(found.size());
  std::vector<double> heights;
  std::vector<double> steepness;
  std::vector<double> drops;
  for (const LowerEnd& end : found) {
    heights.push_back(end.height - ends.up_world().dot(region.center_world));
    steepness.push_back(end.steepness);
    drops.push_back(end.ball_drop * ends.up_world().cross(end.contact_world - axis).norm());
  }
  const double bound = NearestQuantile(std::move(heights), kShareOfBounds);
  const double drop = Median(std::move(drops));
  return MaskBase{.bound = bound, .bottom = bound - Bulge(Median(std::move(steepness))) * drop, .lowest = bound - drop};
}

}  // namespace romap::objects
