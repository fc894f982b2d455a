#include "server/nerf/field_sampler.h"

#include <algorithm>
#include <cmath>

#include "server/nerf/cpu/kernels.h"

namespace romap::nerf {
namespace {

constexpr int kBatch = 512;
constexpr float kOutside = -1e4f;

uint8_t ToByte(float color) { return static_cast<uint8_t>(std::lround(255.0f * std::clamp(color, 0.0f, 1.0f))); }

}  // namespace

void TrainedField::Sample(std::span<const Eigen::Vector3f> p_object, std::span<float> raw, std::span<Rgb8> rgb) const {
  const KernelTable& kernels = SimdKernels().For(model_);
  SampleChunk chunk(kBatch, model_.layout.features, model_.mlp.hidden);
  std::array<size_t, kBatch> source;
  const Eigen::Vector3f half = box_.half_extents.cast<float>();
  const float per_mu = static_cast<float>(1.0 / box_.unit_mu);
  const Eigen::Vector3f extent = box_.ExtentUnit();
  const GridPose grid = box_.GridPose();
  size_t next = 0;
  while (next < p_object.size()) {
    chunk.size = 0;
    for (; next < p_object.size() && chunk.size < kBatch; ++next) {
      raw[next] = kOutside;
      if (!rgb.empty()) rgb[next] = {0, 0, 0};
      // The slack keeps the corners of the box inside despite rounding.
      const Eigen::Vector3f p = (p_object[next] + half) * per_mu;
      constexpr float kSlack = 1e-5f;
      if (!((p.array() >= -kSlack).all() && (p.array() <= extent.array() + kSlack).all())) continue;
      const size_t i = static_cast<size_t>(chunk.size++);
      chunk.x[i] = std::clamp(p.x(), 0.0f, extent.x());
      chunk.y[i] = std::clamp(p.y(), 0.0f, extent.y());
      chunk.z[i] = std::clamp(p.z(), 0.0f, extent.z());
      source[i] = next;
    }
    kernels.to_grid(grid, chunk.size, chunk.x.data(), chunk.y.data(), chunk.z.data());
    kernels.encode(model_.layout, model_.table.data(), chunk.size, chunk.x.data(), chunk.y.data(), chunk.z.data(),
                   chunk.features.data());
    kernels.mlp_forward(model_.mlp, chunk.size, chunk.features.data(), chunk.hidden.data(), chunk.raw.data());
    if (!rgb.empty()) kernels.activate(chunk, model_.density_bias);
    for (size_t i = 0; i < static_cast<size_t>(chunk.size); ++i) {
      raw[source[i]] = chunk.raw[kOutputs * i + 3] + model_.density_bias;
      if (!rgb.empty()) rgb[source[i]] = {ToByte(chunk.red[i]), ToByte(chunk.green[i]), ToByte(chunk.blue[i])};
    }
  }
}

}  // namespace romap::nerf
