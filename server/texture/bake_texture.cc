#include "server/texture/bake_texture.h"

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
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

std::vector<PreparedView> PrepareViews(std::span<const TrainingCamera> views, const Mesh& mesh) {
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

// The views that show a point with the largest weights.
class BestViews {
 public:
  struct Entry {
    ViewedPoint point;
    uint32_t view;
  };

  void Add(const ViewedPoint& point, uint32_t view) {
    if (count_ == kMostSamples && point.weight <= entries_[kMostSamples - 1].point.weight) return;
    int at = count_ < kMostSamples ? count_++ : kMostSamples - 1;
    for (; at > 0 && entries_[at - 1].point.weight < point.weight; --at) entries_[at] = entries_[at - 1];
    entries_[at] = {point, view};
  }
  std::span<const Entry> Entries() const { return std::span(entries_).first(static_cast<size_t>(count_)); }

 private:
  std::array<Entry, kMostSamples> entries_;  // in descending order of the weights
  int count_ = 0;
};

}  // namespace

BakedTexture BakeTexture(const TexturedMesh& textured, std::span<const TrainingCamera> views,
                         const BakeOptions& options) {
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
      BestViews best;
      for (uint32_t view = 0; view < prepared.size(); ++view) {
        ViewedPoint point = prepared[view].Find(texels[i].position, texels[i].normal);
        point.weight *= gains[view].sharpness;
        if (point.weight > 0) best.Add(point, view);
      }
      if (best.Entries().empty()) continue;
      std::array<ViewSample, kMostSamples> samples;
      size_t count = 0;
      for (const auto& [point, view] : best.Entries()) {
        ViewSample& sample = samples[count++] = prepared[view].Sample(point);
        sample.color_bgr *= gains[view].gain_bgr;
        sample.low_bgr *= gains[view].gain_bgr;
      }
      const Eigen::Array3f blended = BlendSamples(std::span(samples).first(count), options.best_view_power);
      const Eigen::Array3i rounded = (blended + 0.5f).cast<int>();
      for (int c = 0; c < 3; ++c) color[texels[i].index][c] = static_cast<uint8_t>(rounded[c]);
      texture.seen.data[texels[i].index] = 255;
    }
  });
  FillUnseen(textured, texels, texture.seen, texture.color_bgr);
  return texture;
}

}  // namespace romap::texture
