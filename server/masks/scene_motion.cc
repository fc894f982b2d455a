#include "server/masks/scene_motion.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <optional>

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

bool TouchesBorder(const MaskThumbnail& thumbnail, uint16_t label) {
  const MaskRegion* region = thumbnail.Find(label);
  return region != nullptr && region->sides > 0;
}

// Gray values of two frames at the same pixels, as sums.
class GrayPairs {
 public:
  void Add(double a, double b) {
    ++count_;
    sum_a_ += a;
    sum_b_ += b;
    sum_aa_ += a * a;
    sum_bb_ += b * b;
    sum_ab_ += a * b;
    change_ += std::abs(a - b);
  }
  int count() const { return count_; }
  double MeanChange() const { return count_ > 0 ? change_ / count_ : 0; }
  // nullopt if there is too little contrast for a comparison.
  std::optional<double> Correlation() const {
    if (count_ == 0) return std::nullopt;
    const double variance_a = sum_aa_ / count_ - sum_a_ * sum_a_ / count_ / count_;
    const double variance_b = sum_bb_ / count_ - sum_b_ * sum_b_ / count_ / count_;
    if (std::min(variance_a, variance_b) < kMinContrast * kMinContrast) return std::nullopt;
    return (sum_ab_ / count_ - sum_a_ * sum_b_ / count_ / count_) / std::sqrt(variance_a * variance_b);
  }

 private:
  int count_ = 0;
  double sum_a_ = 0, sum_b_ = 0, sum_aa_ = 0, sum_bb_ = 0, sum_ab_ = 0, change_ = 0;
};

// The pixels that `use` accepts, given the labels in both frames.
template <class Use>
GrayPairs PairsWhere(const MaskThumbnail& a, const MaskThumbnail& b, const Use& use) {
  GrayPairs pairs;
  for (int v = 0; v < a.labels.rows; ++v) {
    const auto* label_a = a.labels.ptr<uint16_t>(v);
    const auto* label_b = b.labels.ptr<uint16_t>(v);
    const auto* gray_a = a.gray.ptr<uint8_t>(v);
    const auto* gray_b = b.gray.ptr<uint8_t>(v);
    for (int u = 0; u < a.labels.cols; ++u) {
      if (use(label_a[u], label_b[u])) pairs.Add(gray_a[u], gray_b[u]);
    }
  }
  return pairs;
}

// What is not under a mask that reaches the border.
GrayPairs ScenePairs(const MaskThumbnail& a, const MaskThumbnail& b) {
  std::vector<bool> at_border_a(1 << 16, false), at_border_b(1 << 16, false);
  for (const MaskRegion& region : a.regions) at_border_a[region.label] = region.sides > 0;
  for (const MaskRegion& region : b.regions) at_border_b[region.label] = region.sides > 0;
  return PairsWhere(a, b, [&](uint16_t x, uint16_t y) { return !at_border_a[x] && !at_border_b[y]; });
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
  const GrayPairs inside =
      PairsWhere(reference, thumbnail, [&](uint16_t x, uint16_t y) { return x == before && y == label; });
  return inside.MeanChange() <= kMaxChangeShare * ScenePairs(reference, thumbnail).MeanChange();
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
      const bool stayed = TouchesBorder(thumbnail, region.label) &&
                          std::all_of(references_.begin(), references_.end(), [&](const MaskThumbnail& reference) {
                            return StayedSince(reference, thumbnail, region.label);
                          });
      if (stayed) fixed.labels.push_back(region.label);
    }
    fixed.region = FindRegion(thumbnail);
  }
  const std::optional<double> correlation =
      references_.empty() ? std::nullopt : ScenePairs(references_.back(), thumbnail).Correlation();
  if (references_.empty() || (correlation && *correlation < kMovedCorrelation)) {
    references_.push_back(thumbnail);
    if (references_.size() > kReferences) references_.pop_front();
  }
  return fixed;
}

}  // namespace romap::masks
