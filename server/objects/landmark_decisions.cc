#include "server/objects/landmark_decisions.h"

#include <algorithm>
#include <map>

#include "common/angles.h"
#include "server/objects/two_sample_test.h"

namespace romap::objects {
namespace {

// Share of the points inside the cuboid.
double ShareInside(const Cuboid& cuboid, const std::vector<Eigen::Vector3d>& points_world) {
  constexpr double kEnlargement = 1.05;  // of the half extents: points on the surface count as inside
  if (points_world.empty()) return 0;
  const SE3<Object, World> T_object_world = cuboid.T_world_object.Inverse();
  const Eigen::Vector3d half_extents = kEnlargement * cuboid.half_extents;
  const auto inside = std::count_if(points_world.begin(), points_world.end(), [&](const Eigen::Vector3d& p) {
    return ((T_object_world * p).cwiseAbs().array() <= half_extents.array()).all();
  });
  return static_cast<double>(inside) / static_cast<double>(points_world.size());
}

bool DetectedTooRarely(const LandmarkEvidence& evidence, const ObjectsConfig& config) {
  return static_cast<double>(evidence.observations) <
         config.confirm_seen_share * static_cast<double>(evidence.expected);
}

bool MasksDisagree(const LandmarkEvidence& evidence) {
  constexpr uint64_t kMinComparisons = 3;  // observations with an agreement; fewer are not enough to reject
  constexpr double kMinAgreement = 0.5;    // mean agreement of the masks with the shape
  return evidence.agreement_count >= kMinComparisons &&
         evidence.agreement_sum < kMinAgreement * static_cast<double>(evidence.agreement_count);
}

bool HasPlausibleProportions(const Cuboid& cuboid) {
  constexpr double kMaxElongation = 60;  // longest to shortest side; lower for a sheet of paper with a noisy cuboid
  const Eigen::Vector3d& half_extents = cuboid.half_extents;
  return half_extents.minCoeff() > 0 && half_extents.maxCoeff() < kMaxElongation * half_extents.minCoeff();
}

std::vector<Eigen::Vector3d> PointsOf(const Landmark& landmark, const PointRegistry& points) {
  if (!landmark.geometry.cuboid) return landmark.geometry.body_world;
  std::vector<Eigen::Vector3d> points_world;
  for (const MapPointId& id : landmark.geometry.points) {
    if (const Eigen::Vector3d* p_world = points.Find(id)) points_world.push_back(*p_world);
  }
  return points_world;
}

// Whether the map points of both landmarks may belong to one object observed from two sides (MeansAgree); nullopt if
// there are too few points to decide.
std::optional<bool> PointsAgree(const Landmark& a, const Landmark& b, const PointRegistry& points) {
  constexpr double kAlpha = 0.05;            // significance level
  constexpr double kShiftShare = 0.25;       // of the size, between the mean points of two view directions
  constexpr double kPointSigmaShare = 0.02;  // of the size: standard deviation of a map point
  const double size_mu = 2 * (a.geometry.cuboid ? a : b).geometry.cuboid->half_extents.maxCoeff();
  return MeansAgree(PointsOf(a, points), PointsOf(b, points), kAlpha, kShiftShare * size_mu,
                    std::max(kPointSigmaShare * size_mu, 1e-9));
}

// A landmark without a cuboid is compared by its map points alone.
Decision DecideMergeWithPoints(const Landmark& with_cuboid, const Landmark& without, const PointRegistry& points) {
  constexpr double kMinShareInside = 0.7;  // of the points in the cuboid
  if (!(ShareInside(*with_cuboid.geometry.cuboid, without.geometry.body_world) > kMinShareInside)) {
    return {false, "the points lie outside the other cuboid"};
  }
  if (!PointsAgree(with_cuboid, without, points).value_or(false)) return {false, "the map points do not agree"};
  return {true, "same class, and the points lie inside the other cuboid"};
}

}  // namespace

Decision DecideConfirmation(const LandmarkEvidence& evidence, const LandmarkGeometry& geometry,
                            const ObjectsConfig& config) {
  if (!geometry.cuboid) return {false, "no cuboid yet"};
  if (!HasPlausibleProportions(*geometry.cuboid)) return {false, "implausible cuboid proportions"};
  if (DetectedTooRarely(evidence, config)) return {false, "detected in too few of the frames that should show it"};
  if (MasksDisagree(evidence)) return {false, "masks disagree with its shape"};
  // A part of a larger object is covered by that object's mask in most frames.
  const bool is_part = std::any_of(evidence.covered_by.begin(), evidence.covered_by.end(),
                                   [&](const auto& cover) { return cover.second > evidence.observations; });
  if (is_part) return {false, "covered by the mask of another object too often"};
  if (evidence.observations < static_cast<uint64_t>(config.confirm_frames)) return {false, "too few observations"};
  if (evidence.keyframe_observations < config.confirm_keyframes) return {false, "too few keyframes"};
  if (evidence.whole_observations == 0) return {false, "always cut off by the border of the image"};
  // Without map points the masks alone determine the position, which requires a wider baseline.
  constexpr double kParallaxFactorWithoutPoints = 1.5;
  const bool has_points = geometry.points.size() >= static_cast<size_t>(config.min_object_points);
  const double min_parallax_rad =
      (has_points ? 1.0 : kParallaxFactorWithoutPoints) * config.confirm_parallax_deg * kRadPerDeg;
  if (!(geometry.parallax_rad >= min_parallax_rad)) return {false, "too little parallax"};
  return {true, "enough consistent observations"};
}

Decision DecideAnnouncement(const LandmarkEvidence& evidence, const LandmarkGeometry& geometry) {
  constexpr uint64_t kMinObservations = 3;  // frames
  if (!geometry.cuboid) return {false, "no cuboid yet"};
  if (!(geometry.cuboid->half_extents.minCoeff() > 0)) return {false, "cuboid without volume"};
  if (evidence.observations < kMinObservations) return {false, "too few observations"};
  return {true, "has a cuboid"};
}

Decision DecideLoss(ObjectState state, const LandmarkEvidence& evidence, const ObjectsConfig& config) {
  if (state != ObjectState::kConfirmed) return {false, "not confirmed"};
  if (evidence.missed_in_view < config.lost_after_frames) return {false, "missed in too few frames"};
  return {true, "not detected although unoccluded"};
}

Decision DecidePruning(ObjectState state, const LandmarkEvidence& evidence, bool has_cuboid, uint64_t frame_index,
                       const ObjectsConfig& config) {
  if (state == ObjectState::kLost) {
    if (!DetectedTooRarely(evidence, config)) return {false, "detected often enough"};
    return {true, "detected in too few of the frames that should show it"};
  }
  if (state != ObjectState::kProvisional) return {false, "confirmed"};
  // Maximum number of frames in which another object's mask covers the landmark, per observation. At least
  // kMinObservations observations are assumed.
  constexpr uint64_t kMaxCoveredPerObservation = 3;
  constexpr uint64_t kMinObservations = 3;
  for (const auto& [key, count] : evidence.covered_by) {
    if (count > kMaxCoveredPerObservation * std::max(evidence.observations, kMinObservations)) {
      return {true, "part of another object"};
    }
  }
  constexpr int kMaxMissedFrames = 40;
  if (evidence.missed_in_view >= kMaxMissedFrames) return {true, "no longer detected where it was observed"};
  // A landmark with a cuboid had many observations; it may be out of view and return into view later.
  constexpr uint64_t kMaxUnobservedFrames = 40;
  constexpr uint64_t kMaxUnobservedFramesWithCuboid = 400;
  if (frame_index - evidence.last_frame - evidence.dormant_frames >
      (has_cuboid ? kMaxUnobservedFramesWithCuboid : kMaxUnobservedFrames)) {
    return {true, "not observed again"};
  }
  return {false, "may still be confirmed"};
}

Decision DecidePruningAtFinish(ObjectState state) {
  if (state == ObjectState::kProvisional) return {true, "never confirmed before the session finished"};
  return {false, "confirmed"};
}

CoVisibility CountCoVisibility(const Landmark& a, const Landmark& b) {
  const auto count = [](const std::map<LandmarkKey, uint64_t>& counts, LandmarkKey key) {
    const auto found = counts.find(key);
    return found == counts.end() ? uint64_t{0} : found->second;
  };
  return {.together = count(a.evidence.observed_with, b.key),
          .covered = count(a.evidence.covered_by, b.key) + count(b.evidence.covered_by, a.key)};
}

Decision DecideMerge(const Landmark& a, const Landmark& b, const PointRegistry& points) {
  // Thresholds of the overlap: the share of one landmark's body points inside the cuboid of the other landmark, the
  // larger of both shares.
  constexpr double kCertainOverlap = 0.7;
  constexpr double kProbableOverlap = 0.5;
  constexpr double kPossibleOverlap = 0.25;
  // Frames in which one mask covered both landmarks, per frame in which each had its own mask. Above this ratio the
  // detector is assumed to split one object.
  constexpr uint64_t kMaxCoveredPerTogether = 2;

  const auto& cuboid_a = a.geometry.cuboid;
  const auto& cuboid_b = b.geometry.cuboid;
  if (!cuboid_a && !cuboid_b) return {false, "neither has a cuboid"};
  const auto [together, covered] = CountCoVisibility(a, b);
  if (together > 0 && covered <= kMaxCoveredPerTogether * together) return {false, "detected side by side"};
  const bool same_class = a.evidence.BestClass().first == b.evidence.BestClass().first;
  if (!cuboid_a || !cuboid_b) {
    if (!same_class) return {false, "of different classes"};
    if (together > 0) return {false, "detected side by side"};
    return DecideMergeWithPoints(cuboid_a ? a : b, cuboid_a ? b : a, points);
  }
  const double distance_mu = (cuboid_a->T_world_object.translation() - cuboid_b->T_world_object.translation()).norm();
  if (distance_mu > cuboid_a->half_extents.norm() + cuboid_b->half_extents.norm()) return {false, "too far apart"};
  const double overlap =
      std::max(ShareInside(*cuboid_a, b.geometry.body_world), ShareInside(*cuboid_b, a.geometry.body_world));
  if (overlap > kCertainOverlap) return {true, "same volume"};
  if (!same_class) return {false, "of different classes"};
  if (together > 0) return {false, "detected side by side"};
  if (overlap > kProbableOverlap) return {true, "same class and most of the volume"};
  // Cuboids of one object from two distant view directions may disagree on its far side.
  if (!(overlap > kPossibleOverlap)) return {false, "too little overlap"};
  if (!PointsAgree(a, b, points).value_or(true)) return {false, "map points are too far apart"};
  return {true, "same class, part of the volume, and map points that agree"};
}

}  // namespace romap::objects
