#include "server/slam/world_up.h"

#include <spdlog/spdlog.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "server/slam/geometry/support_plane.h"

namespace romap::slam {
namespace {

constexpr double kMinRotation_rad = 0.3 * std::numbers::pi / 180;
constexpr double kMinConfidence = 0.3;
constexpr uint64_t kPeriod_keyframes = 5;
constexpr uint64_t kLongPeriod_keyframes = 20;  // once the confidence is high
constexpr double kHighConfidence = 0.8;
constexpr size_t kMaxCameras = 200;
constexpr double kMaxInsideShare = 0.1;  // of a background point's observations; not 0 because masks have errors
constexpr double kMaxBorderShare = 0.5;

struct Evidence {
  std::vector<SupportPoint> points;
  std::vector<Eigen::Vector3d> object_points;
  std::vector<Eigen::Vector3d> centers;
  std::vector<Eigen::Vector3d> ups;
};

// Points near mask borders in most frames are edges of the objects, slightly above the support plane.
bool IsBackground(const MaskVotes& votes) {
  return votes.inside <= kMaxInsideShare * votes.total() && votes.border <= kMaxBorderShare * votes.total();
}

Evidence GatherEvidence(const SlamMap& map) {
  Evidence evidence;
  for (const auto& [id, track] : map.points()) {
    MaskVotes votes = track.votes;
    for (const FeatureRef& observation : track.observations) {
      votes.Add(map.FindKeyframe(observation.keyframe)->frame->mask_zones[static_cast<size_t>(observation.feature)]);
    }
    if (votes.total() == 0) continue;  // not observed with masks yet
    if (2 * votes.inside > votes.total()) {
      evidence.object_points.push_back(track.point.position_world);
    } else if (IsBackground(votes) && track.observations.size() >= 2) {
      // One pixel across the ray; along the ray, the error grows with 1 / parallax.
      const double parallax_rad = std::max(track.point.max_parallax_rad, 0.02);
      evidence.points.push_back({.position_world = track.point.position_world,
                                 .sigma_mu = track.size_mu / parallax_rad,
                                 .near_object = 2 * (votes.near + votes.border) > votes.total()});
    }
  }
  const size_t step = 1 + map.keyframes().size() / kMaxCameras;
  size_t i = 0;
  for (const auto& [id, keyframe] : map.keyframes()) {
    if (i++ % step != 0) continue;
    evidence.centers.push_back(keyframe.center_world());
    evidence.ups.push_back(keyframe.T_world_camera().rotation() * -Eigen::Vector3d::UnitY());
  }
  return evidence;
}

}  // namespace

void WorldUp::ObserveGravity(const Frame& frame, const SE3<World, Camera>& T_world_camera) {
  if (!frame.gravity_camera) return;
  gravity_.Add(frame, T_world_camera);
  has_gravity_ = true;
}

std::optional<Eigen::Quaterniond> WorldUp::ProposeRotation(const SlamMap& map, bool is_last) {
  Eigen::Vector3d up_world;
  if (has_gravity_) {
    up_world = gravity_.up_world();
    confidence_ = 1;
  } else {
    if (!is_last && map.keyframe_count() < next_fit_) return std::nullopt;
    next_fit_ = map.keyframe_count() + (confidence_ >= kHighConfidence ? kLongPeriod_keyframes : kPeriod_keyframes);
    const Evidence evidence = GatherEvidence(map);
    const auto plane = FindSupportPlane({.points = evidence.points,
                                         .object_points_world = evidence.object_points,
                                         .camera_centers_world = evidence.centers,
                                         .camera_ups_world = evidence.ups,
                                         .seed = map.keyframe_count()});
    if (!plane || plane->confidence < kMinConfidence) return std::nullopt;
    // A clearly worse plane than before is probably another surface of the scene.
    if (plane->confidence < 0.7 * confidence_) return std::nullopt;
    confidence_ = plane->confidence;
    up_world = plane->normal_world;
    spdlog::debug("slam: support plane of {} points, confidence {:.2f}, sigma {:.2f} deg", plane->inliers,
                  plane->confidence, plane->sigma_rad * 180 / std::numbers::pi);
  }
  const double angle_rad = std::acos(std::clamp(up_world.z(), -1.0, 1.0));
  if (!is_last && angle_rad < kMinRotation_rad) return std::nullopt;
  return RotationFromZTo(up_world).conjugate();
}

void WorldUp::Rotate(const Eigen::Quaterniond& R_new_old) { gravity_.Rotate(R_new_old); }

}  // namespace romap::slam
