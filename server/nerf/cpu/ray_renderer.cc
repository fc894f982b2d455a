#include "server/nerf/cpu/ray_renderer.h"

#include <algorithm>

#include "server/nerf/math/composite.h"

namespace romap::nerf {
namespace {

constexpr int kChunkSamples = 1024;

// Rays of one chunk, whose samples are placed and evaluated.
void Composite(std::span<const Ray> rays, std::span<const RaySpan> spans, SampleChunk& c,
               std::vector<RayResult>& results) {
  for (size_t r = 0; r < rays.size(); ++r) {
    const int at = spans[r].first;
    const RaySamples samples{spans[r].count,        c.t.data() + at,
                             c.length.data() + at,  c.alpha.data() + at,
                             c.density.data() + at, {c.red.data() + at, c.green.data() + at, c.blue.data() + at}};
    results.push_back(
        plain::CompositeForward(samples, rays[r].target, LossWeights{}, c.weight.data() + at, c.behind.data() + at));
  }
}

}  // namespace

std::vector<RayResult> RenderRays(const FieldModel& model, const NerfConfig& config, const RenderSpace& space,
                                  std::span<const Ray> rays) {
  const KernelTable& kernels = SimdKernels();
  const SamplingRule rule{.occupied_bits = space.occupied_bits,
                          .extent = space.extent,
                          .finest_step = static_cast<float>(config.min_sample_spacing),
                          .min_samples = std::min(config.min_samples_per_ray, config.max_samples_per_ray),
                          .max_samples = config.max_samples_per_ray,
                          .skip_empty = config.sampling == "occupied"};
  const size_t chunk_rays = static_cast<size_t>(kChunkSamples / config.max_samples_per_ray);
  SampleChunk chunk(kChunkSamples, model.layout.features, model.mlp.hidden);
  std::vector<RaySpan> spans(chunk_rays);
  std::vector<RayResult> results;
  results.reserve(rays.size());
  for (size_t first = 0; first < rays.size(); first += chunk_rays) {
    const std::span<const Ray> some = rays.subspan(first, std::min(chunk_rays, rays.size() - first));
    chunk.size = 0;
    kernels.place_samples(some.data(), static_cast<int>(some.size()), rule, chunk, spans.data());
    kernels.to_grid(space.grid, chunk.size, chunk.x.data(), chunk.y.data(), chunk.z.data());
    kernels.encode(model.layout, model.table.data(), chunk.size, chunk.x.data(), chunk.y.data(), chunk.z.data(),
                   chunk.features.data());
    kernels.mlp_forward(model.mlp, chunk.size, chunk.features.data(), chunk.hidden.data(), chunk.raw.data());
    kernels.activate(chunk, model.density_bias);
    if (model.IsDistance()) {
      kernels.distance_opacity(spans.data(), static_cast<int>(some.size()), model.sharpness, chunk);
    }
    Composite(some, spans, chunk, results);
  }
  return results;
}

}  // namespace romap::nerf
