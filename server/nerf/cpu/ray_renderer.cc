#include "server/nerf/cpu/ray_renderer.h"

#include <algorithm>

#include "server/nerf/cpu/kernels.h"
#include "server/nerf/math/composite.h"
#include "server/nerf/math/losses.h"
#include "server/nerf/model/step_parameters.h"

namespace romap::nerf {
namespace {

constexpr int kRenderChunkSamples = 1024;

// Appends the results of the rays of one chunk, whose samples have been placed and evaluated.
void Composite(std::span<const Ray> rays, std::span<const RaySpan> spans, SampleChunk& c,
               std::vector<RayResult>& results) {
  for (size_t r = 0; r < rays.size(); ++r) {
    const int at = spans[r].first;
    const RaySamples samples{spans[r].count,        c.t.data() + at,
                             c.length.data() + at,  c.alpha.data() + at,
                             c.density.data() + at, {c.red.data() + at, c.green.data() + at, c.blue.data() + at}};
    const RayTarget& target = rays[r].target;
    RayResult result = plain::CompositeForward(samples, target.depth, c.weight.data() + at, c.behind.data() + at);
    result.color_loss = plain::LossOfRay(result, target, LossWeights{}, /*has_partner=*/false, nullptr).color;
    results.push_back(result);
  }
}

}  // namespace

std::vector<RayResult> RenderRays(const FieldModel& model, const NerfConfig& config, const RenderSpace& space,
                                  std::span<const Ray> rays) {
  const KernelTable& kernels = SimdKernels();
  const SamplingRule rule{
      .occupied_bits = space.occupied_bits, .extent = space.extent, .budget = MakeSampleBudget(config)};
  const size_t chunk_rays = static_cast<size_t>(kRenderChunkSamples / config.max_samples_per_ray);
  SampleChunk chunk(kRenderChunkSamples, model.layout.features, model.mlp.hidden);
  std::vector<RaySpan> spans(chunk_rays);
  std::vector<RayResult> results;
  results.reserve(rays.size());
  for (size_t first = 0; first < rays.size(); first += chunk_rays) {
    const std::span<const Ray> chunk_of_rays = rays.subspan(first, std::min(chunk_rays, rays.size() - first));
    chunk.size = 0;
    kernels.place_samples(chunk_of_rays.data(), static_cast<int>(chunk_of_rays.size()), rule, chunk, spans.data());
    kernels.to_grid(space.grid, chunk.size, chunk.x.data(), chunk.y.data(), chunk.z.data());
    kernels.encode(model.layout, model.table.data(), chunk.size, chunk.x.data(), chunk.y.data(), chunk.z.data(),
                   chunk.features.data());
    kernels.mlp_forward(model.mlp, chunk.size, chunk.features.data(), chunk.hidden.data(), chunk.raw.data());
    kernels.activate(chunk, model.density_bias);
    if (model.IsDistance()) {
      kernels.distance_opacity(spans.data(), static_cast<int>(chunk_of_rays.size()), model.sharpness, chunk);
    }
    Composite(chunk_of_rays, spans, chunk, results);
  }
  return results;
}

}  // namespace romap::nerf
