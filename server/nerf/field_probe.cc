#include "server/nerf/field_probe.h"

#include <algorithm>

#include "server/nerf/cpu/ray_renderer.h"
#include "server/nerf/math/ray.h"

namespace romap::nerf {
namespace {

constexpr size_t kProbesPerTile = 1;
constexpr size_t kBorderProbes = 12;
constexpr size_t kBackgroundProbes = 16;

}  // namespace

double ProbeReport::Loss(std::span<const float> view_weights) const {
  double sum = 0, weight = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    sum += view_weights[i] * (views[i].color + 0.5 * views[i].Outline());
    weight += view_weights[i];
  }
  return weight > 0 ? sum / weight : 0;
}

void FieldProbe::Build(const RaySet& rays, size_t views) {
  views_ = views;
  rays_.clear();
  sources_.clear();
  const auto add = [&](const std::vector<const TrainingPixel*>& pixels, size_t view, bool is_object) {
    for (const TrainingPixel* pixel : pixels) {
      rays_.push_back(rays.Through(*pixel, is_object, 0.5f));
      sources_.push_back({static_cast<uint32_t>(view), is_object});
    }
  };
  for (size_t view = 0; view < views; ++view) {
    for (int tile = 0; tile < PixelSampler::kTiles; ++tile) {
      const size_t count = tile == PixelSampler::kBorderTile ? kBorderProbes : kProbesPerTile;
      add(rays.sampler().TilePixels(view, tile, count), view, /*is_object=*/true);
    }
    add(rays.sampler().BackgroundPixels(view, kBackgroundProbes), view, /*is_object=*/false);
  }
}

double FieldProbe::ShareIntersectingBox(const std::array<float, 3>& extent) const {
  int object_rays = 0, intersecting_rays = 0;
  for (const Ray& ray : rays_) {
    float entry = 0, exit = 0;
    if (!ray.target.is_object) continue;
    ++object_rays;
    intersecting_rays += plain::IntersectBox(ray.origin, ray.direction, extent.data(), entry, exit) ? 1 : 0;
  }
  return object_rays > 0 ? static_cast<double>(intersecting_rays) / object_rays : 1;
}

ProbeReport FieldProbe::Measure(const FieldModel& model, const NerfConfig& config, const RenderSpace& space) const {
  const std::vector<RayResult> results = RenderRays(model, config, space, rays_);
  ProbeReport report{std::vector<ViewResidual>(views_)};
  std::vector<int> object_pixels(views_), background_pixels(views_);
  for (size_t i = 0; i < results.size(); ++i) {
    const Source& source = sources_[i];
    ViewResidual& view = report.views[source.view];
    if (!source.is_object) {
      view.spilled += results[i].opacity;
      ++background_pixels[source.view];
      continue;
    }
    view.color += results[i].color_loss;
    view.missing += 1 - results[i].opacity;
    ++object_pixels[source.view];
  }
  for (size_t v = 0; v < views_; ++v) {
    report.views[v].color /= static_cast<float>(std::max(1, object_pixels[v]));
    report.views[v].missing /= static_cast<float>(std::max(1, object_pixels[v]));
    report.views[v].spilled /= static_cast<float>(std::max(1, background_pixels[v]));
  }
  return report;
}

}  // namespace romap::nerf
