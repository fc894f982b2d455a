#include "server/texture/view_gains.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

namespace romap::texture {
namespace {

// Points of the surface that are compared.
constexpr size_t kComparedPoints = 2500;
// Scales of the residuals that are still believed, from iteration to iteration: gains, which are unknown at first,
// cause residuals as well as highlights.
constexpr std::array<float, 5> kResidualScales = {0.5f, 0.3f, 0.2f, 0.12f, 0.08f};
// Weight of gain 1, relative to that of a view's points.
constexpr double kPriorShare = 1e-3;
// Darker colors are noise.
constexpr float kDarkest = 6.0f;
// Variance of the Laplacian that is noise.
constexpr float kNoiseEnergy = 4.0f;

// One point in one view.
struct GainObservation {
  uint32_t view;
  float weight;
  Eigen::Array4f log_value;  // of blue, green, red, and of the square root of the sharpness
};

using GainPoint = std::vector<GainObservation>;

std::vector<GainPoint> ObservePoints(std::span<const PreparedView> views, std::span<const SurfaceTexel> texels) {
  std::vector<GainPoint> points;
  const size_t step = std::max<size_t>(texels.size() / kComparedPoints, 1);
  for (size_t i = step / 2; i < texels.size(); i += step) {
    GainPoint point;
    for (uint32_t view = 0; view < views.size(); ++view) {
      const ViewedPoint viewed = views[view].Find(texels[i].position, texels[i].normal);
      if (!(viewed.weight > 0)) continue;
      GainObservation observation{view, viewed.weight, {}};
      observation.log_value.head<3>() = views[view].Sample(viewed).low_bgr.max(kDarkest).log();
      observation.log_value[3] = 0.5f * std::log(views[view].SharpnessAt(viewed) + kNoiseEnergy);
      point.push_back(observation);
    }
    if (point.size() >= 2) points.push_back(std::move(point));
  }
  // Relative to the best view of the point.
  for (GainPoint& point : points) {
    float largest = 0;
    for (const GainObservation& observation : point) largest = std::max(largest, observation.weight);
    for (GainObservation& observation : point) observation.weight /= largest;
  }
  return points;
}

// The offsets that make one channel of all observations of a point agree.
Eigen::VectorXd SolveOffsets(const std::vector<GainPoint>& points, size_t views, int channel) {
  const auto n = static_cast<Eigen::Index>(views);
  Eigen::VectorXd offsets = Eigen::VectorXd::Zero(n);
  std::vector<double> weights;
  for (const float scale : kResidualScales) {
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd b = Eigen::VectorXd::Zero(n);
    for (const GainPoint& point : points) {
      double sum = 0, mean = 0;
      for (const GainObservation& o : point) {
        sum += o.weight;
        mean += o.weight * (o.log_value[channel] + offsets[o.view]);
      }
      mean /= sum;
      weights.clear();
      double weight_sum = 0, value_sum = 0;
      for (const GainObservation& o : point) {
        const double residual = (o.log_value[channel] + offsets[o.view] - mean) / scale;
        const double trust = 1 + residual * residual;
        weights.push_back(o.weight / (trust * trust));
        weight_sum += weights.back();
        value_sum += weights.back() * o.log_value[channel];
      }
      // The common value of the point is eliminated.
      for (size_t i = 0; i < point.size(); ++i) {
        H(point[i].view, point[i].view) += weights[i];
        b[point[i].view] -= weights[i] * (point[i].log_value[channel] - value_sum / weight_sum);
        for (size_t j = 0; j < point.size(); ++j) {
          H(point[i].view, point[j].view) -= weights[i] * weights[j] / weight_sum;
        }
      }
    }
    H.diagonal().array() += kPriorShare * H.trace() / static_cast<double>(n) + 1e-9;
    offsets = H.ldlt().solve(b);
  }
  return offsets;
}

}  // namespace

std::vector<ViewGain> EstimateViewGains(std::span<const PreparedView> views, std::span<const SurfaceTexel> texels) {
  std::vector<ViewGain> gains(views.size());
  const std::vector<GainPoint> points = ObservePoints(views, texels);
  if (points.empty()) return gains;
  for (int channel = 0; channel < 4; ++channel) {
    const Eigen::VectorXd offsets = SolveOffsets(points, views.size(), channel);
    for (size_t view = 0; view < views.size(); ++view) {
      const auto offset = static_cast<float>(offsets[static_cast<Eigen::Index>(view)]);
      if (channel < 3) {
        gains[view].gain_bgr[channel] = std::clamp(std::exp(offset), 0.5f, 2.0f);
      } else {
        gains[view].sharpness = std::clamp(std::exp(-offset), 0.1f, 2.0f);
      }
    }
  }
  return gains;
}

}  // namespace romap::texture
