#include "server/texture/blend_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace romap::texture {
namespace {

// Deviations from the median color that are normal, in gray levels: noise, interpolation and small errors of the pose
// cause the first; more than the second is never normal.
constexpr float kLeastDeviation = 8.0f;
constexpr float kMostDeviation = 30.0f;
// The same for low frequencies, which agree better.
constexpr float kLeastLowDeviation = 5.0f;
constexpr float kMostLowDeviation = 15.0f;

using Values = std::array<float, kMostSamples>;

// The value at which half of the weight is reached. Few values: sorted by insertion.
float WeightedMedian(const Values& values, const Values& weights, int count) {
  std::array<std::pair<float, float>, kMostSamples> sorted;
  float half = 0;
  for (int i = 0; i < count; ++i) {
    int at = i;
    for (; at > 0 && sorted[at - 1].first > values[i]; --at) sorted[at] = sorted[at - 1];
    sorted[at] = {values[i], weights[i]};
    half += weights[i] / 2;
  }
  int at = 0;
  for (float sum = sorted[0].second; sum < half && at + 1 < count; sum += sorted[at].second) ++at;
  return sorted[at].first;
}

// 1 for deviations within about `scale`, toward 0 beyond twice that.
float Agreement(float deviation, float scale) {
  const float ratio = deviation / (2 * scale);
  const float squared = ratio * ratio;
  return 1 / (1 + squared * squared);
}

}  // namespace

Eigen::Array3f BlendSamples(std::span<const ViewSample> samples, float best_view_power) {
  const auto count = static_cast<int>(samples.size());
  if (count == 1) return samples[0].color_bgr.max(0.0f).min(255.0f);
  // Mild weights, so that a single view never decides.
  Values mild = {}, values = {}, deviations = {};
  for (int i = 0; i < count; ++i) mild[i] = samples[i].weight;
  Eigen::Array3f median;
  for (int c = 0; c < 3; ++c) {
    for (int i = 0; i < count; ++i) values[i] = samples[i].color_bgr[c];
    median[c] = WeightedMedian(values, mild, count);
  }
  for (int i = 0; i < count; ++i) deviations[i] = (samples[i].color_bgr - median).abs().maxCoeff();
  const float scale = std::clamp(1.5f * WeightedMedian(deviations, mild, count), kLeastDeviation, kMostDeviation);
  Values trust = {};
  float trust_sum = 0;
  Eigen::Array3f low = Eigen::Array3f::Zero();
  for (int i = 0; i < count; ++i) {
    trust[i] = Agreement(deviations[i], scale);
    trust_sum += trust[i] * mild[i];
    low += trust[i] * mild[i] * samples[i].low_bgr;
  }
  low /= trust_sum;

  // Low frequencies show what is wrong in the neighborhood of the point.
  float deviation_sum = 0;
  for (int i = 0; i < count; ++i) {
    deviations[i] = (samples[i].low_bgr - low).abs().maxCoeff();
    deviation_sum += trust[i] * mild[i] * deviations[i];
  }
  const float low_scale = std::clamp(1.5f * deviation_sum / trust_sum, kLeastLowDeviation, kMostLowDeviation);
  trust_sum = 0;
  float largest = 0;
  low.setZero();
  for (int i = 0; i < count; ++i) {
    trust[i] *= Agreement(deviations[i], low_scale);
    trust_sum += trust[i] * mild[i];
    low += trust[i] * mild[i] * samples[i].low_bgr;
    largest = std::max(largest, trust[i] * samples[i].weight);
  }
  low /= trust_sum;

  float best_sum = 0;
  Eigen::Array3f high = Eigen::Array3f::Zero();
  for (int i = 0; i < count; ++i) {
    const float relative = trust[i] * samples[i].weight / largest;
    if (relative < 0.3f) continue;  // negligible after the power
    const float weight = std::pow(relative, best_view_power);
    best_sum += weight;
    high += weight * (samples[i].color_bgr - samples[i].low_bgr);
  }
  return (low + high / best_sum).max(0.0f).min(255.0f);
}

}  // namespace romap::texture
