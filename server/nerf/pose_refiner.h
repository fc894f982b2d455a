#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/stage_messages.h"
#include "server/nerf/model/field_model.h"
#include "server/nerf/model/render_space.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/ray_set.h"
#include "server/nerf/training_box.h"
#include "server/nerf/view_alignment.h"

namespace romap::nerf {

// Refines the camera poses of the views during training, because small pose errors blur the field. Every camera is
// moved to where its view fits the current field best. The motion common to all cameras is removed: it would be a
// motion of the object, or a change of its scale, which the views cannot determine. A prior keeps the cameras near
// their given poses; its standard deviation follows the errors found so far, so that accurate cameras stay in place.
class PoseRefiner {
 public:
  explicit PoseRefiner(const NerfConfig& config) : config_(config) {}

  // The view at `index` is new, or has a new given pose.
  void OnView(size_t index, const SE3<World, Camera>& T_world_camera);
  // The pose before refinement.
  const SE3<World, Camera>& given(size_t index) const { return given_[index]; }

  // Whether a refinement is due after `step` steps. The interval doubles with every refinement that hardly moves the
  // views.
  bool IsDue(size_t views, uint64_t step) const;

  // Moves the cameras of `views`. OnView() must have been called for all of them, and `rays` built on them. The common
  // motion is estimated from the views with weight > 0; the others return to their given poses.
  void Refine(std::span<ObjectView> views, std::span<const float> weights, const TrainingBox& box, const RaySet& rays,
              const FieldModel& model, const RenderSpace& space, uint64_t step);

 private:
  void ResetOutliers(std::span<ObjectView> views, std::span<const float> weights, const TrainingBox& box) const;
  void RemoveCommonMotion(std::span<ObjectView> views, std::span<const float> weights, const TrainingBox& box) const;
  double TypicalError_px(std::span<const ObjectView> views, std::span<const float> weights,
                         const TrainingBox& box) const;

  NerfConfig config_;
  std::vector<SE3<World, Camera>> given_;
  double prior_px_ = 0;  // 0: not estimated yet
  uint64_t next_step_ = 0;
  uint64_t interval_steps_ = 0;
};

}  // namespace romap::nerf
