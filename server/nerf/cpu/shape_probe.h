#pragma once

#include <cstdint>
#include <span>

#include "server/nerf/cpu/kernels.h"
#include "server/nerf/model/field_model.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// Evaluates the shape of a signed-distance field near samples of rays and adds the gradients of ShapeLoss. Not
// thread-safe.
class ShapeProbe {
 public:
  ShapeProbe(const NerfConfig& config, const FieldModel& model);

  // Evaluates one sample of a random subset of the rays of a rendered chunk: with equal probability any sample or the
  // one of the largest weight. `spacing`: of the stencil, box sides; `key`: random seed; `scale`: factor of the
  // gradients.
  void AddGradients(const FieldModel& model, const KernelTable& kernels, const SampleChunk& samples,
                    std::span<const RaySpan> spans, float spacing, uint64_t key, float scale, float* table_gradient,
                    float* mlp_gradient);

 private:
  void ChoosePoints(const SampleChunk& samples, std::span<const RaySpan> spans, float spacing, uint64_t key);

  ShapeWeights weights_;
  SampleChunk points_;  // kStencilPoints per chosen sample
};

}  // namespace romap::nerf
