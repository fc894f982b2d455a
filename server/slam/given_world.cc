#include "server/slam/given_world.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "common/angles.h"

namespace romap::slam {
namespace {

constexpr size_t kMaxGivenPoses = 60;
constexpr int64_t kSparsePoses_ns = 200'000'000;  // keyframes may miss poses that are rarer than this
constexpr size_t kPosesToJudge = 15;              // if this number does not agree, the poses contradict the images
constexpr double kMinAgreeingShare = 0.7;
constexpr double kMaxScaleSigma = 0.02;
constexpr double kMaxAlignmentSigma_rad = 0.5 * kRadPerDeg;
// Of single poses, after alignment: larger errors do not come from noise.
constexpr double kMaxPositionSigmaShare = 0.15;  // of the extent of the cameras
constexpr double kMaxPoseSigma_rad = 5 * kRadPerDeg;
// Medians of fewer poses than these say little about noise. Then all of them must agree closely.
constexpr size_t kManyPoses = 6;
constexpr int64_t kFewPosesSpan_ns = 1'000'000'000;  // from the first to the last of a few poses
constexpr double kMaxFewPositionShare = 0.03;        // of the extent of the cameras
constexpr double kMaxFewPose_rad = 1 * kRadPerDeg;

}  // namespace

bool GivenWorld::NeedsPoseAt(int64_t timestamp_ns) const {
  return poses_.empty() || timestamp_ns > poses_.back().timestamp_ns + kSparsePoses_ns;
}

void GivenWorld::Observe(int64_t timestamp_ns, KeyframeId reference, const SE3<Camera, Camera>& T_reference_camera,
                         const SE3<World, Camera>& T_world_camera) {
  poses_.push_back({timestamp_ns, reference, T_reference_camera, T_world_camera});
  if (poses_.size() > kMaxGivenPoses) poses_.pop_front();
  has_new_ = true;
}

std::optional<Sim3<World, World>> GivenWorld::ProposeMotion(const SlamMap& map, bool scale_is_known) {
  if (!std::exchange(has_new_, false)) return std::nullopt;
  std::vector<TwoWorldPose> pairs;
  for (const GivenPose& given : poses_) {
    const auto reference = map.KeyframePose(given.reference);
    if (reference) pairs.push_back({reference->Compose(given.T_reference_camera), given.T_world_camera});
  }
  // Poses that are frequent soon are more.
  const bool are_sparse = poses_.back().timestamp_ns - poses_.front().timestamp_ns >= kFewPosesSpan_ns;
  const size_t needed = are_sparse ? kMinTwoWorldPoses : kManyPoses;
  reason_ = pairs.size() < needed
                ? fmt::format("only {} tracked frames have one; {} are needed", pairs.size(), needed)
                : fmt::format("the camera has not moved enough in the {} tracked frames that have one", pairs.size());
  if (pairs.size() < needed) return std::nullopt;
  const std::optional<WorldAlignment> alignment = AlignWorlds(pairs, scale_is_known);
  if (!alignment) return std::nullopt;
  const bool is_noisy = alignment->position_sigma_mu > kMaxPositionSigmaShare * alignment->extent_mu ||
                        alignment->rotation_sigma_rad > kMaxPoseSigma_rad ||
                        alignment->agreeing_share < kMinAgreeingShare;
  const bool are_few_and_noisy =
      pairs.size() < kManyPoses && (alignment->max_position_mu > kMaxFewPositionShare * alignment->extent_mu ||
                                    alignment->max_rotation_rad > kMaxFewPose_rad);
  if (are_few_and_noisy) {
    reason_ = fmt::format("the {} tracked frames that have one do not agree closely with the map", pairs.size());
  }
  if (is_noisy && pairs.size() >= kPosesToJudge) {
    reason_ = fmt::format(
        "the given poses contradict the images: after alignment they differ by {:.2f} m and {:.1f} deg from the map "
        "(standard deviation per axis; the cameras are {:.2f} m apart), and {:.0f} % of {} agree; check the frame and "
        "the direction of t_world_camera, and its time stamps",
        alignment->position_sigma_mu, alignment->rotation_sigma_rad / kRadPerDeg, alignment->extent_mu,
        100 * alignment->agreeing_share, pairs.size());
  }
  if (is_noisy || are_few_and_noisy || alignment->scale_sigma_ratio > kMaxScaleSigma ||
      alignment->alignment_sigma_rad > kMaxAlignmentSigma_rad) {
    return std::nullopt;
  }
  spdlog::info(
      "slam: the map moves into the client's world by {} given poses: scale {:.4f} +- {:.1f} %, rotation +- {:.2f} deg",
      pairs.size(), alignment->S_given_map.scale(), 100 * alignment->scale_sigma_ratio,
      alignment->alignment_sigma_rad / kRadPerDeg);
  return alignment->S_given_map;
}

std::vector<Diagnostic> GivenWorld::Diagnostics() const {
  if (reason_.empty()) return {};
  return {
      {.code = "poses_ignored",
       .text = "t_world_camera is ignored, because the map was started from images before the first given pose, and "
               "cannot be aligned with the poses yet: " +
               reason_}};
}

}  // namespace romap::slam
