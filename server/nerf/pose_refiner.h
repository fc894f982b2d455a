#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/stage_messages.h"
#include "server/nerf/cpu/ray_renderer.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/ray_set.h"
#include "server/nerf/training_box.h"
#include "server/nerf/view_alignment.h"

namespace romap::nerf {

// Where a field is trained on cameras that are a little off, it blurs. The refiner moves each camera, in turns with
// training, to where its view fits what the field has learned from all. It never moves them all alike: that would be a
// motion of the object, or a change of its size, of which the views cannot tell. How far it believes cameras to be off
// follows from how far it finds them off, so that cameras that are right are left where they are.
class PoseRefiner {
 public:
  explicit PoseRefiner(const NerfConfig& config) : config_(config) {}

  // The view at `index` is new, or its pose was given anew.
  void OnView(size_t index, const SE3<World, Camera>& T_world_camera);
  // The pose that was given.
  const SE3<World, Camera>& given(size_t index) const { return given_[index]; }

  // Whether views should be looked at after `step` steps: often at first, seldom once they no longer move.
  bool IsDue(size_t views, uint64_t step) const;

  // Moves the cameras of `views`, all of which OnView() knows, and on which `rays` was built. Common motion is judged
  // by those whose weight is not 0.
  void Refine(std::span<ObjectView> views, std::span<const float> weights, const TrainingBox& box, const RaySet& rays,
              const nerf::FieldModel& model, const nerf::RenderSpace& space, uint64_t step);

 private:
  void GiveUpOutliers(std::span<ObjectView> views, std::span<const float> weights, const TrainingBox& box) const;
  void RemoveCommonMotion(std::span<ObjectView> views, std::span<const float> weights, const TrainingBox& box) const;
  double TypicalError_px(std::span<const ObjectView> views, std::span<const float> weights,
                         const TrainingBox& box) const;

  NerfConfig config_;
  std::vector<SE3<World, Camera>> given_;
  double prior_px_ = 0;  // 0: nothing was found yet
  uint64_t next_step_ = 0;
  uint64_t interval_steps_ = 0;
};

}  // namespace romap::nerf
