#include "server/slam/mask_zones.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace romap::slam {
namespace {

constexpr int kShrink = 8;           // downscaling factor of the image for kNear
constexpr double kNearShare = 0.08;  // of the image's width
constexpr double kBorder_px = 3;     // for the finest octave

bool AnyMaskWithin(const cv::Mat& labels, const Eigen::Vector2f& pixel_px, int reach_px) {
  const int u = static_cast<int>(std::lround(pixel_px.x()));
  const int v = static_cast<int>(std::lround(pixel_px.y()));
  const int side_px = 2 * reach_px + 1;
  const cv::Rect part = cv::Rect(u - reach_px, v - reach_px, side_px, side_px) & cv::Rect({}, labels.size());
  return !part.empty() && cv::countNonZero(labels(part)) > 0;
}

}  // namespace

MaskZones::MaskZones(const cv::Mat& labels) : labels_(labels) {
  if (labels.empty()) return;
  cv::Mat small;
  const cv::Size size(std::max(1, labels.cols / kShrink), std::max(1, labels.rows / kShrink));
  cv::resize(labels, small, size, 0, 0, cv::INTER_NEAREST);
  const int reach = std::max(1, static_cast<int>(kNearShare * small.cols));
  cv::dilate(small > 0, around_, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
}

MaskZone MaskZones::At(const Eigen::Vector2f& pixel_px, double octave_scale, uint16_t label) const {
  if (labels_.empty()) return MaskZone::kUnknown;
  if (label != 0) return MaskZone::kInside;
  const int u = std::clamp(static_cast<int>(pixel_px.x()) / kShrink, 0, around_.cols - 1);
  const int v = std::clamp(static_cast<int>(pixel_px.y()) / kShrink, 0, around_.rows - 1);
  if (around_.at<uint8_t>(v, u) == 0) return MaskZone::kFar;
  const int reach_px = static_cast<int>(std::lround(kBorder_px * octave_scale));
  return AnyMaskWithin(labels_, pixel_px, reach_px) ? MaskZone::kBorder : MaskZone::kNear;
}

void MaskVotes::Add(MaskZone zone) {
  inside += zone == MaskZone::kInside ? 1 : 0;
  border += zone == MaskZone::kBorder ? 1 : 0;
  near += zone == MaskZone::kNear ? 1 : 0;
  far += zone == MaskZone::kFar ? 1 : 0;
}

void MaskVotes::Add(const MaskVotes& other) {
  inside += other.inside;
  border += other.border;
  near += other.near;
  far += other.far;
}

}  // namespace romap::slam
