#include "server/slam/given_world.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "common/angles.h"

namespace romap::slam {
namespace {

constexpr size_t kMaxGivenPoses = 60;
constexpr size_t kPosesToJudge = 15;  // if this number does not agree, the poses contradict the images
constexpr double kMinAgreeingShare = 0.7;
constexpr double kMaxScaleSigma = 0.02;
constexpr double kMaxAlignmentSigma_rad = 0.5 * kRadPerDeg;
// Of single poses, after alignment: larger errors do not come from noise.
constexpr double kMaxPositionSigmaShare = 0.15;  // of the extent of the cameras
constexpr double kMaxPoseSigma_rad = 5 * kRadPerDeg;

}  // namespace

void GivenWorld::Observe(KeyframeId keyframe, const SE3<World, Camera>& T_world_camera) {
  poses_.emplace_back(keyframe, T_world_camera);
  if (poses_.size() > kMaxGivenPoses) poses_.pop_front();
  has_new_ = true;
}

std::optional<Sim3<World, World>> GivenWorld::ProposeMotion(const SlamMap& map, bool scale_is_known) {
  if (!std::exchange(has_new_, false)) return std::nullopt;
  std::vector<TwoWorldPose> pairs;
  for (const auto& [keyframe, given] : poses_) {
    if (const auto pose = map.KeyframePose(keyframe)) pairs.push_back({pose->T_world_camera, given});
  }
  reason_ = pairs.size() < kMinTwoWorldPoses
                ? fmt::format("only {} keyframes have one; {} are needed", pairs.size(), kMinTwoWorldPoses)
                : fmt::format("the camera has not moved enough in the {} keyframes that have one", pairs.size());
  const std::optional<WorldAlignment> alignment = AlignWorlds(pairs, scale_is_known);
  if (!alignment) return std::nullopt;
  const bool is_noisy = alignment->position_sigma_mu > kMaxPositionSigmaShare * alignment->extent_mu ||
                        alignment->rotation_sigma_rad > kMaxPoseSigma_rad ||
                        alignment->agreeing_share < kMinAgreeingShare;
  if (is_noisy && pairs.size() >= kPosesToJudge) {
    reason_ = fmt::format(
        "the given poses contradict the images: after alignment they differ by {:.2f} m and {:.1f} deg from the map "
        "(standard deviation per axis; the cameras are {:.2f} m apart), and {:.0f} % of {} agree; check the frame and "
        "the direction of t_world_camera, and its time stamps",
        alignment->position_sigma_mu, alignment->rotation_sigma_rad / kRadPerDeg, alignment->extent_mu,
        100 * alignment->agreeing_share, pairs.size());
  }
  if (is_noisy || alignment->scale_sigma_ratio > kMaxScaleSigma ||
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
