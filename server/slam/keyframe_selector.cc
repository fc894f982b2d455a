#include "server/slam/keyframe_selector.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "common/angles.h"
#include "common/statistics.h"

namespace romap::slam {
namespace {

constexpr int kMinGapFrames = 2;      // between keyframes, unless the camera is very fast (kProgressWithoutGap)
constexpr int kMaxWaitFrames = 3;     // maximum wait of a due keyframe for a sharp frame with masks
constexpr double kSharpShare = 0.75;  // minimum sharpness of a sharp frame, as a share of the median of recent frames
constexpr size_t kSharpnessWindowFrames = 15;
constexpr int kMaskMemoryFrames = 30;          // if the last masks are older, keyframes do not wait for masks
constexpr double kMinProgressAfterGap = 0.15;  // minimum progress for a keyframe after keyframe_max_gap_frames
constexpr double kProgressWithoutGap = 2.5;    // above this progress the minimum gap is ignored
constexpr double kMaxProgressToWait = 1.5;     // above this progress a keyframe does not wait for a sharp frame
constexpr double kLowTrackedShare = 0.7;       // of the newest keyframe's points; below it a keyframe is due
constexpr double kUrgentTrackedShare = 0.45;   // below it tracking may fail soon
constexpr double kMinProgressWhileBusy = 2;    // minimum progress while an earlier keyframe is being mapped
constexpr int kWaitingForNone = 2;  // with this many unmapped keyframes none is added: they would come too late
constexpr double kMinProgressToMeasure = 0.5;  // below this progress the baseline is too short to measure depth

}  // namespace

bool KeyframeSelector::IsKeyframe(const Frame& frame, const SE3<World, Camera>& T_world_camera) {
  DepthView view = MakeDepthView(frame, T_world_camera);
  const bool is_sharp_with_masks = IsSharpWithMasks(frame, view.sharpness);
  ++frames_since_keyframe_;
  if (last_keyframe_ && !IsDue(view)) return false;
  if (last_keyframe_ && !is_sharp_with_masks && frames_due_ <= kMaxWaitFrames) return false;
  SetLastKeyframe(std::move(view));
  return true;
}

bool KeyframeSelector::IsKeyframe(const Frame& frame, const SE3<World, Camera>& T_world_camera,
                                  const TrackingQuality& quality) {
  DepthView view = MakeDepthView(frame, T_world_camera);
  const bool is_sharp_with_masks = IsSharpWithMasks(frame, view.sharpness);
  ++frames_since_keyframe_;
  if (!last_keyframe_) {
    SetLastKeyframe(std::move(view));
    return true;
  }
  scene_depth_mu_ = quality.scene_depth_mu;
  const double progress = Progress(T_world_camera);
  const bool timed_out = progress > kMinProgressAfterGap && frames_since_keyframe_ >= config_.keyframe_max_gap_frames;
  const bool has_few_points =
      (quality.tracked_share < kLowTrackedShare && progress > kMinProgressAfterGap) || quality.has_new_depth;
  const bool is_urgent = quality.tracked_share < kUrgentTrackedShare || progress > kProgressWithoutGap;
  bool is_due = progress >= 1 || timed_out || has_few_points || is_urgent;
  if (quality.keyframes_waiting > 0) is_due = is_due && progress >= kMinProgressWhileBusy;
  if (quality.keyframes_waiting >= kWaitingForNone) is_due = false;
  frames_due_ = is_due ? frames_due_ + 1 : 0;
  if (!is_due) return false;
  // A fast camera would move too far before the next sharp frame.
  const bool may_wait = !is_urgent && progress < kMaxProgressToWait && frames_due_ <= kMaxWaitFrames;
  if (!is_sharp_with_masks && may_wait) return false;
  SetLastKeyframe(std::move(view));
  return true;
}

void KeyframeSelector::SetLastKeyframe(DepthView view) {
  last_keyframe_ = std::move(view);
  frames_since_keyframe_ = 0;
  frames_due_ = 0;
  depth_is_of_keyframe_ = false;
}

bool KeyframeSelector::IsDue(const DepthView& view) {
  double progress = Progress(view.T_world_camera);
  if (!depth_is_of_keyframe_ && (!scene_depth_mu_ || progress > kMinProgressToMeasure)) {
    if (const auto depth_mu = SceneDepth(*last_keyframe_, view)) {
      scene_depth_mu_ = depth_mu;
      depth_is_of_keyframe_ = true;
      progress = Progress(view.T_world_camera);
    }
  }

  const bool moved = progress >= 1 && frames_since_keyframe_ >= kMinGapFrames;
  const bool timed_out = progress > kMinProgressAfterGap && frames_since_keyframe_ >= config_.keyframe_max_gap_frames;
  const bool is_due = moved || timed_out || progress > kProgressWithoutGap;
  frames_due_ = is_due ? frames_due_ + 1 : 0;
  return is_due;
}

double KeyframeSelector::Progress(const SE3<World, Camera>& T_world_camera) const {
  const SE3<World, Camera>& last = last_keyframe_->T_world_camera;
  const double rotation_deg = last.rotation().angularDistance(T_world_camera.rotation()) * kDegPerRad;
  double progress = rotation_deg / config_.keyframe_rotation_deg;
  if (scene_depth_mu_) {
    const double distance_mu = (last.translation() - T_world_camera.translation()).norm();
    progress = std::max(progress, distance_mu / (*scene_depth_mu_ * config_.keyframe_translation_ratio));
  }
  return progress;
}

bool KeyframeSelector::IsSharpWithMasks(const Frame& frame, double sharpness) {
  frames_since_mask_ = frame.has_masks ? 0 : std::min(frames_since_mask_ + 1, kMaskMemoryFrames);
  const bool has_expected_masks = frame.has_masks || frames_since_mask_ >= kMaskMemoryFrames;

  recent_sharpness_.push_back(sharpness);
  if (recent_sharpness_.size() > kSharpnessWindowFrames) recent_sharpness_.pop_front();
  const double typical = Median(std::vector<double>(recent_sharpness_.begin(), recent_sharpness_.end()));
  return has_expected_masks && sharpness >= kSharpShare * typical;
}

}  // namespace romap::slam
