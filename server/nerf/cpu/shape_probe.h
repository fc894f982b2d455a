#pragma once

#include <cstdint>
#include <span>

#include "server/nerf/cpu/field_model.h"
#include "server/nerf/cpu/kernels.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// Looks at the shape of a signed-distance field where rays were sampled, and adds the gradients of ShapeLoss. One
// thread at a time.
class ShapeProbe {
 public:
  ShapeProbe(const NerfConfig& config, const FieldModel& model);

  // At a sample of some of the rays of a rendered chunk, half of the time of the one of most weight. `spacing` of the
  // stencil in box sides; `key` makes the choice; `scale` multiplies the gradients.
  void AddGradients(const FieldModel& model, const KernelTable& kernels, const SampleChunk& samples,
                    std::span<const RaySpan> spans, float spacing, uint64_t key, float scale, float* table_gradient,
                    float* mlp_gradient);

 private:
  void Choose(const SampleChunk& samples, std::span<const RaySpan> spans, float spacing, uint64_t key);

  ShapeWeights weights_;
  SampleChunk points_;  // kStencilPoints for each place
};

}  // namespace romap::nerf
