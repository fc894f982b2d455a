#include "server/nerf/field_probe.h"

#include <algorithm>

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
  places_.clear();
  const auto add = [&](const std::vector<const TrainingPixel*>& pixels, size_t view, bool is_object) {
    for (const TrainingPixel* pixel : pixels) {
      rays_.push_back(rays.Through(*pixel, is_object, 0.5f));
      places_.push_back({static_cast<uint32_t>(view), is_object});
    }
  };
  for (size_t view = 0; view < views; ++view) {
    for (int tile = 0; tile < PixelSampler::kTiles; ++tile) {
      const size_t most = tile == PixelSampler::kBorderTile ? kBorderProbes : kProbesPerTile;
      add(rays.sampler().OfTile(view, tile, most), view, /*is_object=*/true);
    }
    add(rays.sampler().OfBackground(view, kBackgroundProbes), view, /*is_object=*/false);
  }
}

double FieldProbe::ShareMeeting(const std::array<float, 3>& extent) const {
  int object = 0, meeting = 0;
  for (const nerf::Ray& ray : rays_) {
    float entry = 0, exit = 0;
    if (!ray.target.is_object) continue;
    ++object;
    meeting += nerf::plain::IntersectBox(ray.origin, ray.direction, extent.data(), entry, exit) ? 1 : 0;
  }
  return object > 0 ? static_cast<double>(meeting) / object : 1;
}

ProbeReport FieldProbe::Look(const nerf::FieldModel& model, const NerfConfig& config,
                             const nerf::RenderSpace& space) const {
  const std::vector<nerf::RayResult> results = nerf::RenderRays(model, config, space, rays_);
  ProbeReport report{std::vector<ViewResidual>(views_)};
  std::vector<int> object(views_), background(views_);
  for (size_t i = 0; i < results.size(); ++i) {
    const Place& place = places_[i];
    ViewResidual& view = report.views[place.view];
    if (!place.is_object) {
      view.spilled += results[i].opacity;
      ++background[place.view];
      continue;
    }
    view.color += results[i].color_loss;
    view.missing += 1 - results[i].opacity;
    ++object[place.view];
  }
  for (size_t v = 0; v < views_; ++v) {
    report.views[v].color /= static_cast<float>(std::max(1, object[v]));
    report.views[v].missing /= static_cast<float>(std::max(1, object[v]));
    report.views[v].spilled /= static_cast<float>(std::max(1, background[v]));
  }
  return report;
}

}  // namespace romap::nerf
