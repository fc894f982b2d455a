#include "server/slam/focal_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "common/angles.h"
#include "common/statistics.h"
#include "server/slam/frame_matching.h"
#include "server/slam/geometry/epipolar.h"

namespace romap::slam {
namespace {

// As PoseCheck: the number of features bounds the time of matching.
constexpr FrameMatching kFocalCheckMatching = {
    .max_distance_bits = kMaxMatchDistance_bits, .max_ratio = kMaxMatchRatio, .max_first = 300};
constexpr size_t kMinFocalMatches = 30;
// Rotation between kept frames, and between the frames of a pair. Descriptors hardly match over more.
constexpr double kKeptStep_rad = 6 * kRadPerDeg;
constexpr double kMinPairRotation_rad = 12 * kRadPerDeg;
constexpr double kMaxPairRotation_rad = 40 * kRadPerDeg;
constexpr size_t kMaxKeptFrames = 8;
constexpr int kMaxPairsPerFrame = 3;
constexpr size_t kMaxFocalPairs = 36;
constexpr size_t kMinFocalPairs = 8;
// Candidates: ratios to the stated focal length, from 1/2 to 2. The middle one is the stated focal length itself.
constexpr int kStepsPerOctave = 16;
constexpr int kStated = kStepsPerOctave;
constexpr int kCandidates = 2 * kStepsPerOctave + 1;
constexpr double kMaxDistance = 12.0 / 640;  // of the image width; larger distances are those of false matches
// The best candidate is stated if it is this different, the costs of all pairs together fall to this share, and this
// share of the pairs prefers it.
constexpr int kMinSteps = 2;  // 9 %
constexpr double kMaxCostRatio = 0.5;
constexpr double kMinPreferringShare = 0.85;

double FocalFactor(int candidate) { return std::exp2(static_cast<double>(candidate - kStated) / kStepsPerOctave); }

CameraModel WithFocalFactor(CameraModel camera, double factor) {
  camera.fx_px *= factor;
  camera.fy_px *= factor;
  return camera;
}

std::vector<double> Distances(const CameraModel& camera, const Motion& motion, std::span<const TwoViewMatch> matches) {
  const Eigen::Matrix3d essential = motion.Essential();
  std::vector<double> distances;
  for (const RayMatch& match : ToRays(camera, matches)) {
    distances.push_back(match.sigma_px * std::sqrt(SampsonChi2(camera, essential, match)) / camera.width_px);
  }
  return distances;
}

double BoundedMeanSquare(std::span<const double> distances) {
  double sum = 0;
  for (const double distance : distances) sum += std::pow(std::min(distance, kMaxDistance), 2);
  return sum / static_cast<double>(distances.size());
}

}  // namespace

void FocalCheck::AddFrame(const std::shared_ptr<const FrameFeatures>& frame, const SE3<World, Camera>& T_world_camera) {
  const KeptFrame newest{frame, T_world_camera};
  const auto rotation_to = [&](const KeptFrame& kept) {
    return kept.T_world_camera.rotation().angularDistance(T_world_camera.rotation());
  };
  if (!kept_.empty() && rotation_to(kept_.back()) < kKeptStep_rad) return;
  int pairs = 0;
  for (auto kept = kept_.begin(); kept != kept_.end() && pairs < kMaxPairsPerFrame; ++kept) {
    const double rotation_rad = rotation_to(*kept);
    if (rotation_rad < kMinPairRotation_rad || rotation_rad > kMaxPairRotation_rad) continue;
    AddPair(*kept, newest);
    ++pairs;
  }
  kept_.push_back(newest);
  if (kept_.size() > kMaxKeptFrames) kept_.pop_front();
}

void FocalCheck::AddPair(const KeptFrame& first, const KeptFrame& second) {
  const SE3<Camera, Camera> T_second_first = second.T_world_camera.Inverse() * first.T_world_camera;
  const double distance_mu = T_second_first.translation().norm();
  if (!(distance_mu > 0)) return;
  const std::vector<TwoViewMatch> matches =
      MatchFrames(*first.features, *second.features, kFocalCheckMatching, config_.pixel_sigma_px);
  if (matches.size() < kMinFocalMatches) return;
  const Motion motion{T_second_first.RotationMatrix(), T_second_first.translation() / distance_mu};
  Pair pair;
  for (int candidate = 0; candidate < kCandidates; ++candidate) {
    const CameraModel camera = WithFocalFactor(second.features->camera, FocalFactor(candidate));
    std::vector<double> distances = Distances(camera, motion, matches);
    pair.costs.push_back(BoundedMeanSquare(distances));
    pair.medians.push_back(Median(std::move(distances)));
  }
  pairs_.push_back(std::move(pair));
  if (pairs_.size() > kMaxFocalPairs) pairs_.pop_front();
  if (first_frame_id_ == 0) first_frame_id_ = first.features->frame_id;
  width_px_ = second.features->camera.width_px;
}

std::optional<Diagnostic> FocalCheck::Check() const {
  if (pairs_.size() < kMinFocalPairs) return std::nullopt;
  std::vector<double> costs(kCandidates, 0);
  for (const Pair& pair : pairs_) {
    for (int candidate = 0; candidate < kCandidates; ++candidate) costs[candidate] += pair.costs[candidate];
  }
  const auto best = static_cast<int>(std::min_element(costs.begin(), costs.end()) - costs.begin());
  if (std::abs(best - kStated) < kMinSteps || costs[best] > kMaxCostRatio * costs[kStated]) return std::nullopt;
  size_t preferring = 0;
  std::vector<double> stated_medians, best_medians;
  for (const Pair& pair : pairs_) {
    preferring += pair.costs[best] < pair.costs[kStated] ? 1 : 0;
    stated_medians.push_back(pair.medians[kStated]);
    best_medians.push_back(pair.medians[best]);
  }
  if (static_cast<double>(preferring) < kMinPreferringShare * static_cast<double>(pairs_.size())) return std::nullopt;
  return Diagnostic{
      .code = "focal_length_inexact",
      .severity = Severity::kWarning,
      .first_frame_id = first_frame_id_,
      .text = fmt::format(
          "the focal length of the camera does not fit the given poses and the images: with one about {:.2f} times as "
          "large, half of the feature matches of {} pairs of frames are within {:.1f} px of their epipolar lines, with "
          "the stated one within {:.1f} px; sizes of objects are wrong",
          FocalFactor(best), pairs_.size(), Median(std::move(best_medians)) * width_px_,
          Median(std::move(stated_medians)) * width_px_),
      .advice =
          "state the intrinsics of the image size that is sent: of another image size, they have to be "
          "multiplied by the ratio of the widths"};
}

}  // namespace romap::slam
