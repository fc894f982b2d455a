#include "server/nerf/depth_edges.h"

#include <cmath>

namespace romap::nerf {
namespace {

// Of the depth, on each side. A plane seen at 85 degrees through 500 px of focal length changes by 2.3 % per pixel.
constexpr float kClearDifference = 0.04F;

bool IsKnown(float z_mu) { return z_mu > 0 && std::isfinite(z_mu); }

}  // namespace

bool IsMixedDepth(const cv::Mat& depth_mu, cv::Point at) {
  const float z_mu = depth_mu.at<float>(at);
  if (!IsKnown(z_mu)) return false;
  const cv::Rect image({0, 0}, depth_mu.size());
  for (const cv::Point step : {cv::Point(1, 0), cv::Point(0, 1), cv::Point(1, 1), cv::Point(1, -1)}) {
    if (!image.contains(at + step) || !image.contains(at - step)) continue;
    const float after_mu = depth_mu.at<float>(at + step), before_mu = depth_mu.at<float>(at - step);
    if (!IsKnown(after_mu) || !IsKnown(before_mu)) continue;
    const float clear_mu = kClearDifference * z_mu;
    if (after_mu - z_mu > clear_mu && z_mu - before_mu > clear_mu) return true;
    if (before_mu - z_mu > clear_mu && z_mu - after_mu > clear_mu) return true;
  }
  return false;
}

}  // namespace romap::nerf
