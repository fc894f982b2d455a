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

  // Height along `up_world` of the highest allowed point between the distances `near_mu` and `far_mu`.
  std::optional<double> HighestAllowed(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
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
      return up_world.dot(origin + inside_mu * direction);
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

}  // namespace

std::optional<double> FindMaskBase(const HullRegion& region, const Eigen::Vector3d& center, double object_size_mu,
                                   const std::vector<Silhouette>& silhouettes) {
  const Eigen::Vector3d up_world = region.R_world_grid.col(2);
  const Eigen::Vector3d center_world = region.ToWorld(center);
  const RayBound bound(silhouettes);
  std::vector<double> heights;
  for (const Silhouette& silhouette : silhouettes) {
    const double distance_mu = (center_world - silhouette.CameraCenter()).norm();
    const double near_mu = std::max(0.1 * distance_mu, distance_mu - object_size_mu);
    const Eigen::Vector3d seen = silhouette.T_world_camera.Inverse() * center_world;
    if (!(seen.z() > 0) || !(near_mu > 0)) continue;
    const int down = DownwardDirection(silhouette, center_world, up_world, 0.1 * object_size_mu);
    if (!silhouette.IsFreeExtent(down, center_world)) continue;
    const double inset_px = kInset_strides * silhouette.masks->stride_px;
    const Eigen::Vector2d tip_px =
        silhouette.extents.tip_px[static_cast<size_t>(down)].cast<double>() - inset_px * ExtentDirection(down);
    const Eigen::Vector3d direction =
        (silhouette.T_world_camera.rotation() * silhouette.camera.Unproject(tip_px.x(), tip_px.y())).normalized();
    const double level = up_world.cross(direction).norm();
    if (level < kMinLevel) continue;
    const auto height =
        bound.HighestAllowed(silhouette.CameraCenter(), direction, up_world, near_mu, distance_mu + object_size_mu);
    if (!height) continue;
    const double inset_mu = inset_px * seen.z() / silhouette.camera.fy_px;
    heights.push_back(*height - inset_mu / level - up_world.dot(region.center_world));
  }
  if (heights.size() < kMinViews) return std::nullopt;
  return NearestQuantile(std::move(heights), kShareOfBounds);
}

}  // namespace romap::objects
