#include "server/nerf/cpu/kernels.h"

namespace romap::nerf {

SampleChunk::SampleChunk(int capacity_, int feature_count, int hidden_width) : capacity(capacity_) {
  const size_t n = static_cast<size_t>(capacity + kMaxLanes);
  for (AlignedBuffer<float>* array :
       {&x, &y, &z, &t, &length, &red, &green, &blue, &density, &alpha, &transmittance, &weight, &behind}) {
    *array = AlignedBuffer<float>(n);
  }
  cell = AlignedBuffer<uint32_t>(n);
  active = AlignedBuffer<uint32_t>(n);
  features = AlignedBuffer<float>(n * static_cast<size_t>(feature_count));
  hidden = AlignedBuffer<float>(n * static_cast<size_t>(hidden_width));
  raw = AlignedBuffer<float>(n * kOutputs);
  d_raw = AlignedBuffer<float>(n * kOutputs);
}

}  // namespace romap::nerf
