#pragma once

#include "common/field_snapshot.h"
#include "server/nerf/model/field_model.h"
#include "server/nerf/training_box.h"

namespace romap::nerf {

// An immutable copy of a trained field; see FieldSampler.
class TrainedField : public FieldSampler {
 public:
  TrainedField(FieldModel model, const TrainingBox& box) : model_(std::move(model)), box_(box) {}
  // Processes batches of 512 points, so calls with many points are faster per point.
  void Sample(std::span<const Eigen::Vector3f> p_object, std::span<float> raw, std::span<Rgb8> rgb) const override;

 private:
  const FieldModel model_;
  const TrainingBox box_;
};

}  // namespace romap::nerf
