#include "server/nerf/training_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "common/status.h"
#include "server/nerf/depth_check.h"
#include "server/nerf/mask_border.h"
#include "server/nerf/view_alignment.h"
#include "server/nerf/view_check.h"

namespace romap::nerf {
namespace {

// Of the longest side of the box.
constexpr double kMaxSmallShift = 0.01;  // a view that moved less keeps its trust and refinement
constexpr double kMinVoteShift = 0.01;   // two thirds of a hull cell; a view that moved as far votes again

// How far a view moved relative to the box: the largest motion of a corner of the box in the camera frame, in longest
// sides of the box.
double ShiftShare(const SE3<World, Camera>& T_old, const SE3<World, Camera>& T_new, const TrainingBox& box) {
  const SE3<Camera, Object> T_old_object = T_old.Inverse() * box.T_world_object;
  const SE3<Camera, Object> T_new_object = T_new.Inverse() * box.T_world_object;
  double largest_mu = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
    const Eigen::Vector3d p = sign.cwiseProduct(box.half_extents);
    largest_mu = std::max(largest_mu, (T_new_object * p - T_old_object * p).norm());
  }
  return largest_mu / box.LongestSide_mu();
}

}  // namespace

// size() if there is no view of the keyframe.
size_t TrainingViews::IndexOf(KeyframeId keyframe) const {
  return static_cast<size_t>(std::ranges::find(views_, keyframe, &ObjectView::keyframe) - views_.begin());
}

absl::Status TrainingViews::Add(ObjectView view, uint64_t step) {
  const size_t index = IndexOf(view.keyframe);
  if (index == kMaxViews) {
    return absl::ResourceExhaustedError(fmt::format("{}: cannot add the view in {}: the limit of {} views is reached",
                                                    view.object.ToString(), view.keyframe.ToString(), kMaxViews));
  }
  const SE3<World, Camera> T_given = view.T_world_camera;
  if (index < views_.size()) {
    Replace(index, std::move(view));
  } else {
    views_.push_back(std::move(view));
  }
  trust_.OnView(index, step);
  CastVote(index);
  refiner_.OnView(index, T_given);
  return absl::OkStatus();
}

absl::StatusOr<std::optional<double>> TrainingViews::Correct(const ViewPose& pose, const TrainingBox& box,
                                                             uint64_t step) {
  const size_t index = IndexOf(pose.keyframe);
  if (index == views_.size()) return std::nullopt;
  ObjectView corrected = views_[index];
  corrected.T_world_camera = pose.T_world_camera;
  ROMAP_RETURN_IF_ERROR(ValidateView(corrected, box));
  const double shift_share = ShiftShare(refiner_.given(index), pose.T_world_camera, box);
  const bool is_small = shift_share < kMaxSmallShift;
  if (is_small) corrected.T_world_camera = WithRefinement(index, pose.T_world_camera, box);
  Replace(index, std::move(corrected));
  if (!is_small) trust_.OnView(index, step);
  if (trust_.trusted(index)) CastVote(index);
  refiner_.OnView(index, pose.T_world_camera);
  return shift_share;
}

// The caller decides on the trust in the new view and on its vote.
void TrainingViews::Replace(size_t index, ObjectView view) {
  if (trust_.trusted(index)) WithdrawVote(index);
  views_[index] = std::move(view);
}

// Applies the refinement of the current pose, relative to the given one, to another given pose.
SE3<World, Camera> TrainingViews::WithRefinement(size_t index, const SE3<World, Camera>& T_world_camera,
                                                 const TrainingBox& box) const {
  const auto to_camera = [&](const SE3<World, Camera>& pose) { return pose.Inverse() * box.T_world_object; };
  const ObjectMotion refinement =
      MotionBetween(to_camera(refiner_.given(index)), to_camera(views_[index].T_world_camera));
  return box.T_world_object * Moved(to_camera(T_world_camera), refinement).Inverse();
}

bool TrainingViews::CheckDepths() {
  const bool was_consistent = quality_.depth_is_consistent;
  quality_.depth_is_consistent = DepthIsConsistent(views_);
  return quality_.depth_is_consistent != was_consistent;
}

bool TrainingViews::MeasureMaskBorder(const RaySet& rays, const FieldModel& model, const RenderSpace& space) {
  const MaskNoise noise = MeasureMaskNoise(views_, trust_.Weights(), rays, model, config_, space);
  const int border_px = UncertainBorder_px(noise, config_.mask_border_spreads);
  if (border_px <= quality_.mask_border_px) return false;
  quality_.mask_border_px = border_px;
  return true;
}

bool TrainingViews::RefinePoses(const TrainingBox& box, const RaySet& rays, const FieldModel& model,
                                const RenderSpace& space, uint64_t step) {
  refiner_.Refine(views_, trust_.Weights(), box, rays, model, space, step);
  bool hull_changed = false;
  for (size_t i = 0; i < views_.size(); ++i) {
    if (!trust_.trusted(i) || ShiftShare(vote_poses_[i], views_[i].T_world_camera, box) < kMinVoteShift) continue;
    WithdrawVote(i);
    CastVote(i);
    hull_changed = true;
  }
  return hull_changed;
}

void TrainingViews::RebuildHull(const TrainingBox& box) {
  hull_.Reset(box, quality_);
  for (size_t i = 0; i < views_.size(); ++i) {
    if (trust_.trusted(i)) CastVote(i);
  }
}

void TrainingViews::CastVote(size_t index) {
  vote_poses_.resize(views_.size());
  vote_poses_[index] = views_[index].T_world_camera;
  hull_.Add(views_[index]);
}

// VisualHull::Remove() needs the pose that the view had when it voted.
void TrainingViews::WithdrawVote(size_t index) {
  ObjectView as_voted = views_[index];
  as_voted.T_world_camera = vote_poses_[index];
  hull_.Remove(as_voted);
}

}  // namespace romap::nerf
