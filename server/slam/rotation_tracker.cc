#include "server/slam/rotation_tracker.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "common/angles.h"
#include "server/slam/frame_matching.h"
#include "server/slam/geometry/homography.h"
#include "server/slam/geometry/motion_search.h"

namespace romap::slam {
namespace {

constexpr FrameMatching kRotationMatching = {.max_distance_bits = 60, .max_ratio = 0.85};
constexpr size_t kMinRotationMatches = 60;
constexpr int kRotationIterations = 100;
// Support per match. Noise costs 0.1 to 0.3, the rest is for moving objects and wrong matches. With parallax, points at
// different depths disagree.
constexpr double kMinRotationSupport = 0.5;
// A translation along a plane looks similar to a rotation, but a homography fits it better.
constexpr double kMinShareOfHomography = 0.9;
constexpr double kMaxFromReference_rad = 15 * kRadPerDeg;

}  // namespace

void RotationTracker::Start(std::shared_ptr<const FrameFeatures> frame, const Eigen::Quaterniond& R_world_camera) {
  reference_ = std::move(frame);
  R_world_reference_ = R_world_camera;
}

std::optional<Eigen::Quaterniond> RotationTracker::Track(const std::shared_ptr<const FrameFeatures>& frame) {
  if (!reference_) return std::nullopt;
  const CameraModel& camera = frame->camera;
  const std::vector<RayMatch> matches =
      ToRays(camera, MatchFrames(*reference_, *frame, kRotationMatching, config_.pixel_sigma_px));
  if (matches.size() < kMinRotationMatches) return std::nullopt;
  const MotionSearch search = SearchMotions(camera, matches, kRotationIterations, config_.Seed(frame->frame_id));
  if (!search.homography) return std::nullopt;
  const Eigen::Matrix3d R_frame_reference = FitRotation(camera, *search.homography, matches);
  const double support = TransferSupport(camera, R_frame_reference, matches);
  if (support < kMinRotationSupport * static_cast<double>(matches.size()) ||
      support < kMinShareOfHomography * search.homography_support) {
    return std::nullopt;
  }
  const Eigen::Quaterniond R_reference_frame(Eigen::Matrix3d(R_frame_reference.transpose()));
  const Eigen::Quaterniond R_world_camera = (R_world_reference_ * R_reference_frame).normalized();
  if (Eigen::AngleAxisd(R_reference_frame).angle() > kMaxFromReference_rad) Start(frame, R_world_camera);
  return R_world_camera;
}

}  // namespace romap::slam
