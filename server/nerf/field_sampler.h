#pragma once

#include "common/field_snapshot.h"
#include "server/nerf/model/field_model.h"
#include "server/nerf/training_box.h"

namespace romap::nerf {

// A frozen copy of a field; see FieldSampler.
class TrainedField : public FieldSampler {
 public:
  TrainedField(nerf::FieldModel model, const TrainingBox& box) : model_(std::move(model)), box_(box) {}
  // Works in batches of some hundred points: ask for many points in one call.
  void Sample(std::span<const Eigen::Vector3f> p_object, std::span<float> raw, std::span<Rgb8> rgb) const override;

 private:
  const nerf::FieldModel model_;
  const TrainingBox box_;
};

}  // namespace romap::nerf
