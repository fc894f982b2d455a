#pragma once

// A training step whose input is on the device, for measurements of single launches.

#include <algorithm>

#include "server/nerf/cuda/step_buffers.h"
#include "server/nerf/model/step_source.h"

namespace romap::nerf::cuda {

// The rays of the first `steps` steps in page-locked memory.
inline absl::StatusOr<PinnedArray<Ray>> RaysOfSteps(const NerfConfig& config, const StepSource& source, int steps) {
  const size_t per_step = static_cast<size_t>(config.rays_per_step);
  ROMAP_ASSIGN_OR_RETURN(PinnedArray<Ray> rays, PinnedArray<Ray>::Allocate(per_step * static_cast<size_t>(steps)));
  for (size_t i = 0; i < rays.size(); ++i) rays.data()[i] = source.ray(i / per_step, static_cast<int>(i % per_step));
  return rays;
}

// Buffers with field, occupancy and the rays of the first `steps` steps. Every launch then works on the first step.
inline absl::StatusOr<StepBuffers> LoadStep(const NerfConfig& config, const TrainingState& field,
                                            const Occupancy& occupancy, const StepSource& source, int steps,
                                            cudaStream_t stream) {
  ROMAP_ASSIGN_OR_RETURN(StepBuffers buffers, StepBuffers::Create(config, field.model, steps));
  ROMAP_RETURN_IF_ERROR(buffers.Upload(field, occupancy, stream));
  ROMAP_ASSIGN_OR_RETURN(const PinnedArray<Ray> rays, RaysOfSteps(config, source, steps));
  SliceState slice{.next = 0, .running = 0, .first_step = 0, .extent = {}, .grid = source.grid};
  std::ranges::copy(source.extent, slice.extent);
  const float learning_rate = source.learning_rate(0);
  ROMAP_RETURN_IF_ERROR(CopyToDevice(buffers.rays.data(), rays.data(), rays.bytes(), stream));
  ROMAP_RETURN_IF_ERROR(CopyToDevice(buffers.slice.data(), &slice, sizeof(slice), stream));
  ROMAP_RETURN_IF_ERROR(CopyToDevice(buffers.learning_rate.data(), &learning_rate, sizeof(float), stream));
  ROMAP_RETURN_IF_ERROR(ToStatus(PrepareStep(buffers.launch().step, MlpPath::kTensorCores), "prepare a step"));
  ROMAP_RETURN_IF_ERROR(Synchronize(stream));
  return buffers;
}

}  // namespace romap::nerf::cuda
