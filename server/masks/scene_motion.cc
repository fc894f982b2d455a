#include "server/masks/scene_motion.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace romap::masks {
namespace {

constexpr size_t kReferences = 4;          // motions of the scene that a mask must have survived
constexpr double kSamePlaceIou = 0.8;      // of a mask in two frames
constexpr double kMovedCorrelation = 0.8;  // of the gray values of two frames; below it the scene has moved
constexpr double kMinContrast = 6;         // gray levels: standard deviation without which no motion can be seen
constexpr double kMaxChangeShare = 0.4;    // of the mean change of gray values in the mask, relative to the scene's

// Parts without a mask.
constexpr float kMinTexture = 8;            // gray levels: standard deviation in a window of the thumbnail
constexpr float kMaxChange = 0.5F;          // of that standard deviation
constexpr double kStayingShare = 0.8;       // of the textured pixels around
constexpr double kMinTexturedAround = 0.3;  // of the pixels around
constexpr double kMinRegion = 0.005;        // of the image
constexpr int kBorder = 2;                  // thumbnail pixels

// The pixels that are under no mask that reaches the border, CV_8UC1.
cv::Mat SceneOf(const MaskThumbnail& thumbnail) {
  cv::Mat scene(thumbnail.labels.size(), CV_8UC1, cv::Scalar(255));
  for (const MaskRegion& region : thumbnail.regions) {
    if (region.sides > 0) scene.setTo(0, thumbnail.labels == region.label);
  }
  return scene;
}

// Mean absolute difference of the gray values where `selected` is not 0.
double MeanChange(const MaskThumbnail& a, const MaskThumbnail& b, const cv::Mat& selected) {
  cv::Mat change;
  cv::absdiff(a.gray, b.gray, change);
  return cv::mean(change, selected)[0];
}

// Whether the scene moved between two frames. False if it has too little contrast to tell.
bool HasMoved(const MaskThumbnail& a, const MaskThumbnail& b) {
  const cv::Mat scene = SceneOf(a) & SceneOf(b);
  if (cv::countNonZero(scene) == 0) return false;
  cv::Scalar mean_a, mean_b, deviation_a, deviation_b;
  cv::meanStdDev(a.gray, mean_a, deviation_a, scene);
  cv::meanStdDev(b.gray, mean_b, deviation_b, scene);
  if (std::min(deviation_a[0], deviation_b[0]) < kMinContrast) return false;
  cv::Mat product;
  cv::multiply(a.gray, b.gray, product, 1, CV_32F);
  const double covariance = cv::mean(product, scene)[0] - mean_a[0] * mean_b[0];
  return covariance < kMovedCorrelation * deviation_a[0] * deviation_b[0];
}

// The label of the mask in `other` that has the same place; 0 if there is none.
uint16_t SamePlace(const MaskThumbnail& thumbnail, uint16_t label, const MaskThumbnail& other) {
  for (const MaskRegion& region : other.regions) {
    if (region.sides > 0 && MaskIou(thumbnail, label, other, region.label) >= kSamePlaceIou) return region.label;
  }
  return 0;
}

// Whether the mask kept its place and its appearance, although the scene changed.
bool StayedSince(const MaskThumbnail& reference, const MaskThumbnail& thumbnail, uint16_t label) {
  const uint16_t before = SamePlace(thumbnail, label, reference);
  if (before == 0) return false;
  const cv::Mat inside = (reference.labels == before) & (thumbnail.labels == label);
  const cv::Mat scene = SceneOf(reference) & SceneOf(thumbnail);
  return MeanChange(reference, thumbnail, inside) <= kMaxChangeShare * MeanChange(reference, thumbnail, scene);
}

}  // namespace

// A textured pixel that does not change while the scene moves belongs to a part that moves with the camera. Pixels
// without texture are filled in between.
cv::Mat SceneMotion::FindRegion(const MaskThumbnail& thumbnail) const {
  cv::Mat current, mean, mean_square;
  thumbnail.gray.convertTo(current, CV_32F);
  cv::blur(current, mean, {5, 5});
  cv::blur(current.mul(current), mean_square, {5, 5});
  const cv::Mat variance = mean_square - mean.mul(mean);
  const cv::Mat textured = variance > kMinTexture * kMinTexture;
  cv::Mat stays = textured.clone();
  for (const MaskThumbnail& reference : references_) {
    cv::Mat before;
    reference.gray.convertTo(before, CV_32F);
    const cv::Mat change = current - before;
    stays &= change.mul(change) < kMaxChange * kMaxChange * variance;
  }
  // Where most of the textured pixels around stay.
  cv::Mat textured_around, staying_around;
  cv::blur(textured, textured_around, {9, 9});
  cv::blur(stays, staying_around, {9, 9});
  cv::Mat needed;
  textured_around.convertTo(needed, CV_8U, kStayingShare);
  cv::Mat region = (staying_around >= needed) & (textured_around > kMinTexturedAround * 255);
  cv::morphologyEx(region, region, cv::MORPH_CLOSE, cv::Mat::ones(7, 7, CV_8U));
  // Components that reach the border.
  cv::Mat components, statistics, centers;
  const int count = cv::connectedComponentsWithStats(region, components, statistics, centers);
  cv::Mat kept = cv::Mat::zeros(region.size(), CV_8U);
  for (int c = 1; c < count; ++c) {
    const cv::Rect box(statistics.at<int>(c, cv::CC_STAT_LEFT), statistics.at<int>(c, cv::CC_STAT_TOP),
                       statistics.at<int>(c, cv::CC_STAT_WIDTH), statistics.at<int>(c, cv::CC_STAT_HEIGHT));
    const bool at_border = box.x <= kBorder || box.y <= kBorder || box.br().x >= region.cols - kBorder ||
                           box.br().y >= region.rows - kBorder;
    if (!at_border || statistics.at<int>(c, cv::CC_STAT_AREA) < kMinRegion * thumbnail.pixels()) continue;
    kept.setTo(255, components == c);
  }
  if (cv::countNonZero(kept) == 0) return {};
  cv::dilate(kept, kept, cv::Mat::ones(3, 3, CV_8U));
  return kept;
}

SceneMotion::CameraFixed SceneMotion::Find(const MaskThumbnail& thumbnail) {
  CameraFixed fixed;
  if (thumbnail.gray.empty()) return fixed;
  std::erase_if(references_,
                [&](const MaskThumbnail& reference) { return reference.labels.size() != thumbnail.labels.size(); });
  if (references_.size() == kReferences) {
    for (const MaskRegion& region : thumbnail.regions) {
      const bool stayed =
          region.sides > 0 && std::all_of(references_.begin(), references_.end(), [&](const MaskThumbnail& reference) {
            return StayedSince(reference, thumbnail, region.label);
          });
      if (stayed) fixed.labels.push_back(region.label);
    }
    fixed.region = FindRegion(thumbnail);
  }
  if (references_.empty() || HasMoved(references_.back(), thumbnail)) {
    references_.push_back(thumbnail);
    if (references_.size() > kReferences) references_.pop_front();
  }
  return fixed;
}

}  // namespace romap::masks
