#include "server/texture/bake_texture.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "common/parallel_for.h"
#include "server/texture/blend_samples.h"
#include "server/texture/fill_unseen.h"
#include "server/texture/prepared_view.h"
#include "server/texture/surface_texels.h"
#include "server/texture/view_gains.h"

namespace romap::texture {
namespace {

constexpr size_t kTexelsPerTask = 4096;

std::vector<PreparedView> PrepareViews(std::span<const TextureView> views, const Mesh& mesh) {
  std::vector<std::optional<PreparedView>> prepared(views.size());
  ParallelFor(views.size(), [&](size_t i) {
    if (ValidateTextureView(views[i]).ok()) prepared[i].emplace(views[i], mesh);
  });
  std::vector<PreparedView> valid;
  valid.reserve(views.size());
  for (std::optional<PreparedView>& view : prepared) {
    if (view.has_value()) valid.push_back(std::move(*view));
  }
  return valid;
}

}  // namespace

BakedTexture BakeTexture(const TexturedMesh& textured, std::span<const TextureView> views, const BakeOptions& options) {
  BakedTexture texture;
  texture.color_bgr = cv::Mat(textured.atlas_px, textured.atlas_px, CV_8UC3, cv::Scalar::all(128));
  texture.seen = cv::Mat::zeros(textured.atlas_px, textured.atlas_px, CV_8UC1);
  const std::vector<SurfaceTexel> texels = FindSurfaceTexels(textured);
  if (texels.empty()) return texture;
  const std::vector<PreparedView> prepared = PrepareViews(views, textured.mesh);
  const std::vector<ViewGain> gains = EstimateViewGains(prepared, texels);
  auto* color = reinterpret_cast<cv::Vec3b*>(texture.color_bgr.data);
  ParallelForRanges(texels.size(), kTexelsPerTask, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      BestSamples best;
      for (size_t view = 0; view < prepared.size(); ++view) {
        ViewSample sample = prepared[view].Look(texels[i].position, texels[i].normal);
        if (!(sample.weight > 0)) continue;
        sample.weight *= gains[view].sharpness;
        sample.color_bgr *= gains[view].gain_bgr;
        sample.low_bgr *= gains[view].gain_bgr;
        best.Add(sample);
      }
      if (best.count == 0) continue;
      const Eigen::Array3i rounded = (BlendSamples(best, options.best_view_power) + 0.5f).cast<int>();
      for (int c = 0; c < 3; ++c) color[texels[i].index][c] = static_cast<uint8_t>(rounded[c]);
      texture.seen.data[texels[i].index] = 255;
    }
  });
  FillUnseen(textured, texels, texture.seen, texture.color_bgr);
  return texture;
}

}  // namespace romap::texture
