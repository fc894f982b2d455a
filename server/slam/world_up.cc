#include "server/slam/world_up.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "common/angles.h"
#include "server/slam/geometry/level_cameras.h"
#include "server/slam/geometry/scene_planes.h"
#include "server/slam/geometry/support_plane.h"
#include "server/slam/geometry/up_fusion.h"

namespace romap::slam {
namespace {

constexpr double kMinRotation_rad = 0.3 * kRadPerDeg;
constexpr double kGravitySigma_rad = 0.5 * kRadPerDeg;
// Prior probability that a person holds the camera. A camera on a mount may have any constant roll.
constexpr double kLevelReliability = 0.8;
// Prior probabilities that a large plane of a scene is horizontal or vertical.
constexpr double kHorizontalReliability = 0.4;
constexpr double kVerticalReliability = 0.4;
constexpr double kSamePlane_rad = 20 * kRadPerDeg;
constexpr double kMinConfidence = 0.3;  // to turn the world
// An estimate may be less confident than the one before by this factor if it is about the same direction.
constexpr double kMaxLoss = 0.7;
constexpr double kSmallTurn_rad = 5 * kRadPerDeg;
// Up is known if it is right with this probability and within this standard deviation.
constexpr double kKnownConfidence = 0.7;
constexpr double kKnownSigma_rad = 0.7 * kRadPerDeg;  // per axis: about 1 degree in total
constexpr double kSupportConfidence = 0.7;
constexpr uint64_t kPeriod_keyframes = 5;
constexpr uint64_t kLongPeriod_keyframes = 20;  // once the confidence is high
constexpr double kHighConfidence = 0.8;
constexpr size_t kMaxCameras = 200;
constexpr double kMaxInsideShare = 0.1;  // of a background point's observations; not 0 because masks have errors
constexpr double kMaxMaskShare = 0.3;    // the same, including observations at the border of a mask

struct Evidence {
  std::vector<SupportPoint> points;
  std::vector<Eigen::Vector3d> object_points;
  std::vector<Eigen::Vector3d> centers;
  std::vector<Eigen::Vector3d> ups;
  std::vector<Eigen::Vector3d> rights;
};

// Points of an object, including those of its outline: corners of the outline are detected beside the mask, and on a
// plain table there are no other points near the object.
bool IsObject(const MaskVotes& votes) { return 2 * (votes.inside + votes.border) > votes.total(); }

bool IsBackground(const MaskVotes& votes) {
  return votes.inside <= kMaxInsideShare * votes.total() &&
         votes.inside + votes.border <= kMaxMaskShare * votes.total();
}

Evidence GatherEvidence(const SlamMap& map) {
  Evidence evidence;
  for (const auto& [id, track] : map.points()) {
    MaskVotes votes = track.votes;
    for (const FeatureRef& observation : track.observations) {
      votes.Add(map.FindKeyframe(observation.keyframe)->frame->mask_zones[static_cast<size_t>(observation.feature)]);
    }
    if (votes.total() == 0) continue;  // not observed with masks yet
    if (IsObject(votes)) {
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
    evidence.rights.push_back(keyframe.T_world_camera().rotation() * Eigen::Vector3d::UnitX());
  }
  return evidence;
}

// Large planes of a scene are mostly walls or floors. The support itself is not counted twice.
void AddScenePlanes(const Evidence& evidence, const std::optional<SupportPlane>& support, const Eigen::Vector3d& guess,
                    uint64_t seed, std::vector<UpClue>& clues) {
  const double max_same_cosine = std::cos(kSamePlane_rad);
  for (const PlaneFit& found : FindScenePlanes(evidence.points, seed)) {
    const Eigen::Vector3d normal = found.plane.normal.dot(guess) < 0 ? -found.plane.normal : found.plane.normal;
    if (support && normal.dot(support->normal_world) > max_same_cosine) continue;
    clues.push_back({.vector_world = normal,
                     .sigma_rad = found.sigma_rad / std::numbers::sqrt2,
                     .reliability = kHorizontalReliability});
    clues.push_back({.kind = UpClue::Kind::kPerpendicular,
                     .vector_world = normal,
                     .sigma_rad = found.sigma_rad / std::numbers::sqrt2,
                     .reliability = kVerticalReliability});
  }
}

}  // namespace

void WorldUp::ObserveGravity(const Frame& frame, const SE3<World, Camera>& T_world_camera) {
  if (!frame.gravity_camera) return;
  gravity_.Add(frame, T_world_camera);
  has_gravity_ = true;
}

// Returns whether the map shows an up direction.
bool WorldUp::UpdateFromMap(const SlamMap& map, bool is_last) {
  const Evidence evidence = GatherEvidence(map);
  Eigen::Vector3d guess = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& up : evidence.ups) guess += up;
  if (!(guess.norm() > 0)) return false;
  guess.normalize();
  std::vector<UpClue> clues;
  const auto plane = FindSupportPlane({.points = evidence.points,
                                       .object_points_world = evidence.object_points,
                                       .camera_centers_world = evidence.centers,
                                       .camera_ups_world = evidence.ups,
                                       .seed = map.keyframe_count()});
  if (plane) {
    clues.push_back({.vector_world = plane->normal_world,
                     .sigma_rad = plane->sigma_rad / std::numbers::sqrt2,
                     .reliability = plane->confidence});
  }
  AddScenePlanes(evidence, plane, guess, map.keyframe_count(), clues);
  const auto level = UpFromLevelCameras(evidence.rights, evidence.ups);
  if (level) {
    clues.push_back({.vector_world = level->up_world, .sigma_rad = level->sigma_rad, .reliability = kLevelReliability});
  }
  if (clues.empty()) return false;
  const FusedUp fused = FuseUp(clues, guess);
  spdlog::debug(
      "slam: up with confidence {:.2f}, sigma {:.2f} deg, {:.2f} deg from z; support plane: {} points, confidence "
      "{:.2f}, sigma {:.2f} deg, {:.2f} deg from z; cameras: sigma {:.2f} deg, roll {:.2f} deg, {:.2f} deg from z",
      fused.confidence, fused.sigma_rad / kRadPerDeg, std::acos(fused.direction_world.z()) / kRadPerDeg,
      plane ? plane->inliers : 0, plane ? plane->confidence : 0, plane ? plane->sigma_rad / kRadPerDeg : 0,
      plane ? std::acos(plane->normal_world.z()) / kRadPerDeg : 0, level ? level->sigma_rad / kRadPerDeg : 0,
      level ? level->roll_rad / kRadPerDeg : 0, level ? std::acos(level->up_world.z()) / kRadPerDeg : 0);
  // A clearly worse estimate than before is probably due to another surface of the scene. At the end, all evidence is
  // available.
  const double turn_rad = std::acos(std::clamp(fused.direction_world.dot(up_world_), -1.0, 1.0));
  const double required = (turn_rad < kSmallTurn_rad ? kMaxLoss : 1) * confidence_;
  if (!is_last && fused.confidence < required) return false;
  if (fused.confidence < kMinConfidence) {
    confidence_ = fused.confidence;
    return false;
  }
  up_world_ = fused.direction_world;
  confidence_ = fused.confidence;
  sigma_rad_ = fused.sigma_rad;
  rests_on_support_ =
      plane && plane->confidence >= kSupportConfidence && plane->normal_world.dot(up_world_) > std::cos(kSmallTurn_rad);
  return true;
}

std::optional<Eigen::Quaterniond> WorldUp::ProposeRotation(const SlamMap& map, bool is_last) {
  if (has_gravity_) {
    up_world_ = gravity_.up_world();
    confidence_ = 1;
    sigma_rad_ = kGravitySigma_rad;
  } else {
    if (!is_last && map.keyframe_count() < next_fit_) return std::nullopt;
    next_fit_ = map.keyframe_count() + (confidence_ >= kHighConfidence ? kLongPeriod_keyframes : kPeriod_keyframes);
    if (!UpdateFromMap(map, is_last)) return std::nullopt;
  }
  const double angle_rad = std::acos(std::clamp(up_world_.z(), -1.0, 1.0));
  // A turn within the uncertainty is not worth the correction of the whole map.
  if (!is_last && angle_rad < std::max(kMinRotation_rad, sigma_rad_ / 2)) return std::nullopt;
  return RotationFromZTo(up_world_).conjugate();
}

void WorldUp::Assume(const Eigen::Vector3d& up_world) {
  if (confidence_ == 0) up_world_ = up_world;
}

void WorldUp::Rotate(const Eigen::Quaterniond& R_new_old) {
  gravity_.Rotate(R_new_old);
  up_world_ = R_new_old * up_world_;
}

bool WorldUp::is_known() const { return confidence_ >= kKnownConfidence && sigma_rad_ <= kKnownSigma_rad; }

std::vector<Diagnostic> WorldUp::Diagnostics() const {
  if (is_known()) return {};
  const std::string guess =
      confidence_ > 0
          ? fmt::format("the best guess is right with a probability of {:.0f} % and a standard deviation of {:.1f} deg",
                        100 * confidence_, sigma_rad_ * kDegPerRad)
          : "the first camera is assumed to be level";
  return {{.code = "up_unknown",
           .text = fmt::format("the images do not show clearly where up is, so cuboids may be tilted: {}; send "
                               "gravity_camera with the frames, or show the surface around the objects",
                               guess)}};
}

}  // namespace romap::slam
