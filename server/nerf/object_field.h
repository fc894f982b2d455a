#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/cuboid.h"
#include "common/field_snapshot.h"
#include "common/stage_messages.h"
#include "server/nerf/field_probe.h"
#include "server/nerf/gain_meter.h"
#include "server/nerf/model/occupancy.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/pose_refiner.h"
#include "server/nerf/ray_set.h"
#include "server/nerf/train_stats.h"
#include "server/nerf/trainer.h"
#include "server/nerf/training_box.h"
#include "server/nerf/training_plan.h"
#include "server/nerf/view_trust.h"
#include "server/nerf/visual_hull.h"

namespace romap::nerf {

// One object's neural field with its views and its training (paper, section on the NeRF model). Not thread-safe: one
// owner at a time. Snapshots are independent of it.
class ObjectField {
 public:
  // The same seed, inputs and thread counts give the same field.
  ObjectField(const NerfConfig& config, ObjectId id, uint64_t seed);

  // The object's cuboid, before enlargement. A cuboid that still fits the training box changes nothing. For another one
  // the box is made anew and what is learned is carried over; training goes on, the longer the more of the new box is
  // unknown. Only a box that has little in common with the old one starts a new training. INVALID_ARGUMENT: pose or
  // size that cannot be.
  absl::Status SetBox(const Cuboid& cuboid);

  // Adds a view, or replaces the one of the same keyframe. FAILED_PRECONDITION: no box yet, or the view is of another
  // object. INVALID_ARGUMENT: see ValidateView.
  absl::Status AddView(ObjectView view);

  // The map was corrected: the object's space underwent `S_new_old`, and boxes and views come in the new world from now
  // on. What is learned is relative to the box, which goes along with all views, so nothing is trained anew. A motion
  // that is not finite is passed over.
  void Move(const Sim3<World, World>& S_new_old);

  // The corrected pose, in the new world, of a view that is there; one that is not (any more) is passed over. Training
  // goes on from what is learned, the longer the more changed. What training itself found the old pose to be off is
  // taken to hold for one close to it too. INVALID_ARGUMENT: see ValidateView; then the view stays as it was.
  absl::Status CorrectView(const ViewPose& pose);

  // What is wrong with what the object was given, for people: views that were refused or that contradict the others, a
  // box that misses what the masks show, and the like. Empty: nothing is known to be wrong.
  std::string Concern() const;

  // `steps` steps of optimisation on `threads` (1..64) threads. Nothing happens without box and views.
  TrainStats Train(int steps, int threads);

  // The field as it is now. `converged` is left false; the caller knows whether more training is planned.
  FieldSnapshot Snapshot() const;

  // Memory that only Train() needs is given back until the next call.
  void ReleaseScratch() { trainer_->ReleaseScratch(); }

  ObjectId id() const { return id_; }
  int views() const { return static_cast<int>(views_.size()); }
  uint64_t steps() const { return trainer_->steps_done(); }
  // Share of the loss that 100 steps take away at present; nothing while that is not known.
  std::optional<double> LossFall() const { return gain_.FallPer100Steps(); }
  // Steps the training plan allows now; `complete`: no more views are expected. 0 once training has diverged again and
  // again with the views there are.
  uint64_t AllowedSteps(bool complete) const;

 private:
  absl::Status FitBox(const Cuboid& cuboid);
  absl::Status Refuse(absl::Status why);
  size_t TakeView(ObjectView view, bool keep_verdict);
  SE3<World, Camera> WithRefinement(size_t index, const SE3<World, Camera>& T_world_camera) const;
  double ShiftShare(const SE3<World, Camera>& T_old, const SE3<World, Camera>& T_new) const;
  bool CarryOverTo(const TrainingBox& box);
  void Restart();
  void PrepareViews();
  uint64_t StepsUntilLook() const;
  TrainStats RunSteps(int steps, int threads);
  void JudgeDepths();
  void Look();
  void RefinePoses();
  void RebuildHull();
  void VoteOnHull(size_t view);
  void WithdrawVote(size_t view);
  bool CanTrain() const;
  nerf::RenderSpace Space() const;
  size_t MostRedundantView(const ObjectView& view) const;

  NerfConfig config_;
  ObjectId id_;
  uint64_t seed_;
  uint64_t restarts_ = 0;
  int divergences_ = 0;  // since the last new view or box
  double loosened_ = 1;  // how far the features were shrunk for new boxes since training began
  // The field lives in the world as it was when the object was first told of, whatever corrections follow: box, views
  // and hull below never move. What comes in is taken back to that world, what goes out is brought to the present one.
  Sim3<World, World> S_new_first_;
  TrainingBox box_;
  bool has_box_ = false;
  bool views_changed_ = false;
  std::vector<ObjectView> views_;  // with their refined poses
  VisualHull hull_;
  RaySet rays_;
  FieldProbe probe_;
  ViewTrust trust_;
  PoseRefiner refiner_;
  std::vector<SE3<World, Camera>> voted_;  // where the views were when they voted on the hull
  GainMeter gain_;
  std::string box_fault_, view_fault_;  // of the last box or view that was refused
  int refused_views_ = 0;
  bool motion_refused_ = false;
  int black_views_ = 0;
  bool depths_fit_ = true;
  double share_in_box_ = 1;  // of the rays through its masks
  nerf::Occupancy occupancy_;
  TrainingPlan plan_;
  std::unique_ptr<nerf::Trainer> trainer_;
  double train_seconds_ = 0;
  double loss_ = 0;
};

}  // namespace romap::nerf
