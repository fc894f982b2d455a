#include "server/masks/scene_motion.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>

namespace romap::masks {
namespace {

constexpr size_t kReferences = 3;          // motions of the scene that a mask must have survived
constexpr double kSamePlaceIou = 0.8;      // of a mask in two frames
constexpr double kMovedCorrelation = 0.8;  // of the gray values of two frames; below it the scene has moved
constexpr double kMinContrast = 6;         // gray levels: standard deviation without which no motion can be seen
constexpr double kMaxChangeShare = 0.6;    // of the mean change of gray values in the mask, relative to the scene's

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

std::vector<uint16_t> SceneMotion::FindCameraFixed(const MaskThumbnail& thumbnail) {
  std::vector<uint16_t> fixed;
  if (thumbnail.gray.empty()) return fixed;
  std::erase_if(references_,
                [&](const MaskThumbnail& reference) { return reference.labels.size() != thumbnail.labels.size(); });
  if (references_.size() == kReferences) {
    for (const MaskRegion& region : thumbnail.regions) {
      const bool stayed = TouchesBorder(thumbnail, region.label) &&
                          std::all_of(references_.begin(), references_.end(), [&](const MaskThumbnail& reference) {
                            return StayedSince(reference, thumbnail, region.label);
                          });
      if (stayed) fixed.push_back(region.label);
    }
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
