#include "server/slam/scene_depth.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "common/image_sharpness.h"
#include "common/statistics.h"

namespace romap::slam {
namespace {

constexpr int kWidth_px = 160;
constexpr int kBlock_px = 16;
constexpr int kDepths = 24;
// The parallax (baseline over depth) of the planes, evenly spaced on a log scale. A smaller parallax is not measurable
// at this image size.
constexpr double kFirstParallax = 0.008;
constexpr double kLastParallax = 0.4;
constexpr int kMinVotes = 8;       // blocks
constexpr float kDistinct = 0.6F;  // maximum ratio of the best cost of a block to its mean cost

// Maps pixels of one view to pixels of another one via the plane z = depth_mu in the first camera.
cv::Matx33d PlaneHomography(const DepthView& first, const DepthView& second, double depth_mu) {
  const SE3<Camera, Camera> T_second_first = second.T_world_camera.Inverse() * first.T_world_camera;
  Eigen::Matrix3d K_first_inverse, K_second;
  const CameraModel& a = first.camera;
  const CameraModel& b = second.camera;
  K_first_inverse << 1 / a.fx_px, 0, -a.cx_px / a.fx_px, 0, 1 / a.fy_px, -a.cy_px / a.fy_px, 0, 0, 1;
  K_second << b.fx_px, 0, b.cx_px, 0, b.fy_px, b.cy_px, 0, 0, 1;
  Eigen::Matrix3d plane = T_second_first.RotationMatrix();
  plane.col(2) += T_second_first.translation() / depth_mu;
  const Eigen::Matrix3d H = K_second * plane * K_first_inverse;
  return {H(0, 0), H(0, 1), H(0, 2), H(1, 0), H(1, 1), H(1, 2), H(2, 0), H(2, 1), H(2, 2)};
}

// Mean absolute difference of each block; infinite where a block leaves the other image.
cv::Mat BlockCosts(const DepthView& first, const DepthView& second, double depth_mu) {
  cv::Mat warped, valid;
  const cv::Matx33d H = PlaneHomography(first, second, depth_mu);
  const cv::Size size = first.gray.size();
  cv::warpPerspective(second.gray, warped, H, size, cv::INTER_LINEAR | cv::WARP_INVERSE_MAP);
  const cv::Mat inside(second.gray.size(), CV_8UC1, cv::Scalar(255));
  cv::warpPerspective(inside, valid, H, size, cv::INTER_NEAREST | cv::WARP_INVERSE_MAP);

  cv::Mat difference, costs, coverage;
  cv::absdiff(first.gray, warped, difference);
  const cv::Size blocks(size.width / kBlock_px, size.height / kBlock_px);
  const cv::Rect whole(0, 0, blocks.width * kBlock_px, blocks.height * kBlock_px);
  difference(whole).convertTo(difference, CV_32F);
  valid(whole).convertTo(valid, CV_32F);
  cv::resize(difference, costs, blocks, 0, 0, cv::INTER_AREA);
  cv::resize(valid, coverage, blocks, 0, 0, cv::INTER_AREA);
  costs.setTo(std::numeric_limits<float>::infinity(), coverage < 254);
  return costs;
}

std::optional<double> MedianDepth(const cv::Mat& depth_mu) {
  constexpr int kStep_px = 8;
  std::vector<float> depths;
  for (int v = 0; v < depth_mu.rows; v += kStep_px) {
    for (int u = 0; u < depth_mu.cols; u += kStep_px) {
      if (const float z = depth_mu.at<float>(v, u); z > 0) depths.push_back(z);
    }
  }
  if (depths.empty()) return std::nullopt;
  return Median(std::move(depths));
}

// Measured at half the image's size, which preserves strong motion blur but averages out noise.
double HalfSizeSharpness(const cv::Mat& image_bgr) {
  cv::Mat half;
  cv::resize(image_bgr, half, {}, 0.5, 0.5, cv::INTER_AREA);
  return ImageSharpness(half);
}

}  // namespace

DepthView MakeDepthView(const Frame& frame, const SE3<World, Camera>& T_world_camera) {
  const double scale = std::min(1.0, static_cast<double>(kWidth_px) / frame.image_bgr.cols);
  DepthView view{.camera = frame.camera, .T_world_camera = T_world_camera};
  cv::Mat small;
  cv::resize(frame.image_bgr, small, {}, scale, scale, cv::INTER_AREA);
  cv::cvtColor(small, view.gray, cv::COLOR_BGR2GRAY);
  const double scale_x = static_cast<double>(view.gray.cols) / frame.image_bgr.cols;
  const double scale_y = static_cast<double>(view.gray.rows) / frame.image_bgr.rows;
  view.camera.width_px = view.gray.cols;
  view.camera.height_px = view.gray.rows;
  view.camera.fx_px *= scale_x;
  view.camera.fy_px *= scale_y;
  view.camera.cx_px = (view.camera.cx_px + 0.5) * scale_x - 0.5;  // pixel centers are at integer coordinates
  view.camera.cy_px = (view.camera.cy_px + 0.5) * scale_y - 0.5;
  view.sharpness = HalfSizeSharpness(frame.image_bgr);
  if (!frame.depth_mu.empty()) view.sensor_depth_mu = MedianDepth(frame.depth_mu);
  return view;
}

std::optional<double> SceneDepth(const DepthView& first, const DepthView& second) {
  if (first.sensor_depth_mu) return first.sensor_depth_mu;
  const double baseline_mu = (first.T_world_camera.translation() - second.T_world_camera.translation()).norm();
  if (!(baseline_mu > 0) || first.gray.cols < kBlock_px || first.gray.rows < kBlock_px) return std::nullopt;

  std::array<double, kDepths> depths_mu;
  std::vector<cv::Mat> costs;
  for (int i = 0; i < kDepths; ++i) {
    const double parallax = kFirstParallax * std::pow(kLastParallax / kFirstParallax, i / (kDepths - 1.0));
    depths_mu[i] = baseline_mu / parallax;
    costs.push_back(BlockCosts(first, second, depths_mu[i]));
  }

  std::vector<double> votes;
  for (int row = 0; row < costs[0].rows; ++row) {
    for (int col = 0; col < costs[0].cols; ++col) {
      int best = 0;
      float sum = 0;
      int finite = 0;
      for (int i = 0; i < kDepths; ++i) {
        const float cost = costs[i].at<float>(row, col);
        if (cost < costs[best].at<float>(row, col)) best = i;
        if (!std::isfinite(cost)) continue;
        sum += cost;
        ++finite;
      }
      // A block votes if one depth is distinct and not at either end, where the true depth may lie beyond the range.
      const bool distinct = finite > kDepths / 2 && costs[best].at<float>(row, col) < kDistinct * sum / finite;
      if (distinct && best > 0 && best < kDepths - 1) votes.push_back(depths_mu[best]);
    }
  }
  if (votes.size() < kMinVotes) return std::nullopt;
  return Median(std::move(votes));
}

}  // namespace romap::slam
