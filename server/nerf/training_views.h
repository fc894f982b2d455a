#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/stage_messages.h"
#include "server/nerf/field_probe.h"
#include "server/nerf/model/field_model.h"
#include "server/nerf/model/render_space.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/pose_refiner.h"
#include "server/nerf/ray_set.h"
#include "server/nerf/training_box.h"
#include "server/nerf/view_trust.h"
#include "server/nerf/visual_hull.h"

namespace romap::nerf {

// The training views of one object with all state per view: the refined pose, the trust, and the vote on the visual
// hull. All poses are in one fixed world frame. Only trusted views vote.
class TrainingViews {
 public:
  // The visual hull counts votes in 8 bits.
  static constexpr size_t kMaxViews = 255;

  explicit TrainingViews(const NerfConfig& config) : config_(config), refiner_(config), hull_(config) {}

  bool empty() const { return views_.empty(); }
  size_t size() const { return views_.size(); }
  std::span<const ObjectView> views() const { return views_; }
  bool trusted(size_t index) const { return trust_.trusted(index); }
  // One per view: 1 trusted, 0 not.
  std::vector<float> Weights() const { return trust_.Weights(); }
  const InputQuality& quality() const { return quality_; }

  // Adds a view, or replaces the view of the same keyframe. RESOURCE_EXHAUSTED: there are kMaxViews other views.
  absl::Status Add(ObjectView view, uint64_t step);

  // Sets the corrected pose of the view of a keyframe. After a small correction the view keeps its trust, and its
  // refinement relative to the given pose; after a larger one both are reset. Returns how far the view moved, in sides
  // of the box; nullopt if there is no such view. INVALID_ARGUMENT: see ValidateView; the view is unchanged.
  absl::StatusOr<std::optional<double>> Correct(const ViewPose& pose, const TrainingBox& box, uint64_t step);

  // Checks again whether dense depth is consistent with the masks. True if the result changed; then the hull must be
  // rebuilt.
  bool CheckDepths();

  // Measures the uncertain border of the masks again. `rays` must have been built on these views. True if it became
  // wider; then the rays and the hull must be rebuilt. It never becomes narrower, because a wider
  // hull fits the noisy masks better, which hides their noise.
  bool MeasureMaskBorder(const RaySet& rays, const FieldModel& model, const RenderSpace& space);

  // Updates the trust in every view. True if any changed; then the hull must be rebuilt.
  bool UpdateTrust(const ProbeReport& report, uint64_t step) { return trust_.Update(report, step); }
  // Trusts all views again.
  void ResetTrust() { trust_.Restart(); }

  // See PoseRefiner::IsDue.
  bool RefinementIsDue(uint64_t step) const { return refiner_.IsDue(views_.size(), step); }
  // Moves the cameras to where they fit the field best. `rays` must have been built on these views. True if the hull
  // changed.
  bool RefinePoses(const TrainingBox& box, const RaySet& rays, const FieldModel& model, const RenderSpace& space,
                   uint64_t step);

  // Discards all votes on the hull, and lets the trusted views vote on `box`.
  void RebuildHull(const TrainingBox& box);
  // See VisualHull::Carve.
  std::vector<uint8_t> CarveHull() const { return hull_.Carve(); }

 private:
  size_t IndexOf(KeyframeId keyframe) const;
  void Replace(size_t index, ObjectView view);
  SE3<World, Camera> WithRefinement(size_t index, const SE3<World, Camera>& T_world_camera,
                                    const TrainingBox& box) const;
  void CastVote(size_t index);
  void WithdrawVote(size_t index);

  std::vector<ObjectView> views_;  // with their refined poses
  ViewTrust trust_;
  NerfConfig config_;
  PoseRefiner refiner_;
  VisualHull hull_;
  std::vector<SE3<World, Camera>> vote_poses_;  // poses of the views when they voted on the hull
  InputQuality quality_;
};

}  // namespace romap::nerf
