#include "server/nerf/cpu/shape_probe.h"

#include <algorithm>
#include <array>

#include "server/nerf/math/random.h"
#include "server/nerf/math/signed_distance.h"
#include "server/nerf/model/step_parameters.h"

namespace romap::nerf {
namespace {

constexpr int kMaxChosen = 200;            // samples per chunk
constexpr float kShareOfRays = 0.25f;      // a chosen sample costs as much as five ordinary ones
constexpr float kShareOfAnySample = 0.5f;  // the other choices are the sample nearest to the surface

int SampleOfLargestWeight(const SampleChunk& samples, const RaySpan& span) {
  const float* weight = samples.weight.data() + span.first;
  return static_cast<int>(std::max_element(weight, weight + span.count) - weight);
}

}  // namespace

ShapeProbe::ShapeProbe(const NerfConfig& config, const FieldModel& model)
    : weights_(MakeShapeWeights(config)),
      points_(kMaxChosen * kStencilPoints, model.layout.features, model.mlp.hidden) {}

void ShapeProbe::ChoosePoints(const SampleChunk& samples, std::span<const RaySpan> spans, float spacing, uint64_t key) {
  points_.size = 0;
  for (size_t r = 0; r < spans.size(); ++r) {
    const RaySpan& span = spans[r];
    if (points_.size == points_.capacity || span.count == 0) continue;
    const auto random = [&](uint64_t of) { return RandomUniform(key, r, of); };
    if (random(0) >= kShareOfRays) continue;
    const int sample = random(1) < kShareOfAnySample ? static_cast<int>(random(2) * static_cast<float>(span.count))
                                                     : SampleOfLargestWeight(samples, span);
    const size_t from = static_cast<size_t>(span.first + sample);
    const std::array<float, 3> at = {samples.x[from], samples.y[from], samples.z[from]};
    const std::array<float*, 3> to = {points_.x.data(), points_.y.data(), points_.z.data()};
    for (int a = 0; a < 3; ++a) {
      const float center = at[a] + spacing * (2 * random(3 + static_cast<uint64_t>(a)) - 1);
      for (int p = 0; p < kStencilPoints; ++p) to[a][points_.size + p] = center + spacing * plain::StencilOffset(p, a);
    }
    points_.size += kStencilPoints;
  }
}

void ShapeProbe::AddGradients(const FieldModel& model, const KernelTable& kernels, const SampleChunk& samples,
                              std::span<const RaySpan> spans, float spacing, uint64_t key, float scale,
                              float* table_gradient, float* mlp_gradient) {
  ChoosePoints(samples, spans, spacing, key);
  SampleChunk& p = points_;
  if (p.size == 0) return;
  kernels.encode(model.layout, model.table.data(), p.size, p.x.data(), p.y.data(), p.z.data(), p.features.data());
  kernels.mlp_forward(model.mlp, p.size, p.features.data(), p.hidden.data(), p.raw.data());
  for (int first = 0; first < p.size; first += kStencilPoints) {
    std::array<float, kStencilPoints> distance, d_distance;
    for (int i = 0; i < kStencilPoints; ++i) distance[i] = -kDistancePerRaw * p.raw[kOutputs * (first + i) + 3];
    plain::ShapeLoss(weights_, spacing, distance.data(), d_distance.data());
    for (int i = 0; i < kStencilPoints; ++i) {
      float* d = p.d_raw.data() + kOutputs * (first + i);
      d[0] = d[1] = d[2] = 0;
      d[3] = -kDistancePerRaw * d_distance[i] * scale;
    }
  }
  kernels.mlp_backward(model.mlp, p.size, p.features.data(), p.hidden.data(), p.d_raw.data(), mlp_gradient);
  kernels.encode_backward(model.layout, p.size, p.x.data(), p.y.data(), p.z.data(), p.features.data(), table_gradient);
}

}  // namespace romap::nerf
