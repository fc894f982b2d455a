#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "server/nerf/model/field_model.h"
#include "server/nerf/model/occupancy.h"
#include "server/nerf/model/render_space.h"
#include "server/nerf/model/step_source.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/train_stats.h"
#include "server/nerf/trainer.h"
#include "server/nerf/training_box.h"

namespace romap::nerf {

// The field of one object with its training box, model, optimizer and occupancy grid. Training requires a box.
class BoxedField {
 public:
  // The result of FitTo().
  enum class BoxChange { kNone, kFirst, kTransferred, kRestarted };
  struct Fit {
    BoxChange change = BoxChange::kNone;
    double unknown_share = 0;  // kTransferred: the share of the new box that lies outside the old one, 0..1
  };

  // `config.hidden_width` must be a multiple of 16. The same seed gives the same untrained field.
  BoxedField(const NerfConfig& config, uint64_t seed);

  // Makes the box fit the cuboid. If the cuboid still fits the box, nothing changes. Otherwise the learned field is
  // transferred to a new box, or restarted if the two boxes overlap too little. SetHull() must follow a change.
  Fit FitTo(const Cuboid& cuboid);

  // Discards everything learned. The box and its hull stay.
  void Restart();

  // The visual hull of the box; see Occupancy::SetHull.
  void SetHull(std::vector<uint8_t> hull) { occupancy_.SetHull(std::move(hull)); }

  // Trains on the rays of `source` in this box, on `threads` (1..64) threads.
  TrainStats Run(StepSource source, int steps, int threads);

  // Frees the memory that only Run() needs, until the next Run().
  void ReleaseScratch() { trainer_->ReleaseScratch(); }

  bool has_box() const { return has_box_; }
  const TrainingBox& box() const { return box_; }
  const FieldModel& model() const { return trainer_->model(); }
  uint64_t steps() const { return trainer_->steps_done(); }
  // For rendering. Valid until the field changes.
  RenderSpace Space() const;
  // See Occupancy::TrimmedHull.
  std::vector<uint8_t> TrimmedHull() const { return occupancy_.TrimmedHull(config_.hull_trim_share); }

 private:
  Fit TransferTo(const TrainingBox& box);

  NerfConfig config_;
  uint64_t seed_;
  uint64_t restarts_ = 0;
  TrainingBox box_;
  bool has_box_ = false;
  double feature_scale_ = 1;  // product of all Trainer::ShrinkFeatures() since training started
  Occupancy occupancy_;
  std::unique_ptr<Trainer> trainer_;
};

}  // namespace romap::nerf
