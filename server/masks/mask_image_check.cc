#include "server/masks/mask_image_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <opencv2/imgproc.hpp>

#include "common/statistics.h"

namespace romap::masks {
namespace {

constexpr double kEdgeUnit = 256;
constexpr size_t kMaxBorderPixels = 500;
constexpr size_t kMinBorderPixels = 25;
// Of the counts with each new mask, so that about the last hundred count.
constexpr double kKeptShare = 0.99;
constexpr double kMinMasks = 12;    // that have an image at a shift
constexpr double kMinGain = 1.15;   // of the fit at the best shift over that without
constexpr double kMinBetter = 0.8;  // share of the masks that fit better at the best shift
// Images that are at least this number of frames away show something else, if the scene moves at all. About half of the
// masks of other images fit their own one better than those; of sound masks nearly all do.
constexpr int kFarShift = 15;
constexpr int kMinFarImages = 8;
constexpr double kMinJudgedMasks = 24;
constexpr double kMaxFittingShare = 0.6;
constexpr double kMaxOverlap = 0.6;  // of the borders of masks far away; above it, the masks hardly move
constexpr size_t kIntervals = 100;

std::vector<cv::Point> BorderOf(const cv::Mat& labels) {
  std::vector<cv::Point> border;
  for (int y = 1; y + 1 < labels.rows; ++y) {
    const auto* row = labels.ptr<uint16_t>(y);
    const auto* below = labels.ptr<uint16_t>(y + 1);
    for (int x = 1; x + 1 < labels.cols; ++x) {
      if (row[x] != row[x + 1] || row[x] != below[x]) border.emplace_back(x, y);
    }
  }
  const size_t step = border.size() / kMaxBorderPixels + 1;
  for (size_t k = 0; k * step < border.size(); ++k) border[k] = border[k * step];
  border.resize((border.size() + step - 1) / step);
  return border;
}

cv::Mat NearBorder(const std::vector<cv::Point>& border, const cv::Size& size) {
  cv::Mat near(size, CV_8UC1, cv::Scalar(0));
  for (const cv::Point& pixel : border) near.at<uint8_t>(pixel) = 255;
  cv::dilate(near, near, cv::Mat::ones(5, 5, CV_8UC1));
  return near;
}

cv::Mat EdgesOf(const cv::Mat& gray) {
  cv::Mat dx, dy, edges;
  cv::Sobel(gray, dx, CV_32F, 1, 0);
  cv::Sobel(gray, dy, CV_32F, 0, 1);
  cv::magnitude(dx, dy, edges);
  const double mean = cv::mean(edges)[0];
  cv::Mat quantized;
  edges.convertTo(quantized, CV_16U, mean > 0 ? kEdgeUnit / mean : 0);
  return quantized;
}

}  // namespace

double MaskImageCheck::Fit(const Frame& masks, const Frame& image) {
  double sum = 0;
  for (const cv::Point& pixel : masks.border) sum += image.edges.at<uint16_t>(pixel);
  return sum / (kEdgeUnit * static_cast<double>(masks.border.size()));
}

double MaskImageCheck::Overlap(const Frame& masks, const Frame& others) {
  int near = 0;
  for (const cv::Point& pixel : masks.border) near += others.near_border.at<uint8_t>(pixel) != 0 ? 1 : 0;
  return static_cast<double>(near) / static_cast<double>(masks.border.size());
}

void MaskImageCheck::Compare(Frame& masks, size_t masks_index, size_t image_index) {
  const Frame& image = frames_[image_index];
  const int shift = static_cast<int>(image_index) - static_cast<int>(masks_index);
  if (shift == 0 || std::abs(shift) > kMaxShift || masks.border.empty()) return;
  const double fit = Fit(masks, image);
  Shift& counts = shifts_[shift];
  counts.masks = kKeptShare * counts.masks + 1;
  counts.better = kKeptShare * counts.better + (fit > masks.fit ? 1 : 0);
  counts.fit = kKeptShare * counts.fit + fit;
  counts.own_fit = kKeptShare * counts.own_fit + masks.fit;
  if (std::abs(shift) < kFarShift) return;
  masks.far_fits += fit;
  ++masks.far_images;
  if (image.border.empty()) return;
  masks.far_overlaps += Overlap(masks, image);
  ++masks.far_masks;
}

void MaskImageCheck::Verdict::Add(const Frame& masks) {
  if (masks.far_images < kMinFarImages || masks.far_masks == 0) return;
  this->masks = kKeptShare * this->masks + 1;
  fitting = kKeptShare * fitting + (masks.fit * masks.far_images > masks.far_fits ? 1 : 0);
  overlap = kKeptShare * overlap + masks.far_overlaps / masks.far_masks;
}

void MaskImageCheck::AddImage(uint64_t frame_id, int64_t timestamp_ns, const cv::Mat& gray) {
  if (!frames_.empty()) {
    if (frames_.back().edges.size() != gray.size()) return;
    intervals_ns_.push_back(timestamp_ns - frames_.back().timestamp_ns);
    if (intervals_ns_.size() > kIntervals) intervals_ns_.pop_front();
  }
  frames_.push_back({.frame_id = frame_id, .timestamp_ns = timestamp_ns, .edges = EdgesOf(gray), .border = {}});
  // Masks may arrive late: each image stays until all masks near it have had their time.
  if (frames_.size() > 3 * static_cast<size_t>(kMaxShift)) {
    concluded_.Add(frames_.front());
    frames_.pop_front();
  }
  for (size_t k = 0; k + 1 < frames_.size(); ++k) Compare(frames_[k], k, frames_.size() - 1);
}

void MaskImageCheck::AddMasks(uint64_t frame_id, const MaskThumbnail& masks) {
  const auto found =
      std::find_if(frames_.begin(), frames_.end(), [&](const Frame& frame) { return frame.frame_id == frame_id; });
  if (found == frames_.end() || found->edges.size() != masks.labels.size()) return;
  found->border = BorderOf(masks.labels);
  if (found->border.size() < kMinBorderPixels) found->border.clear();
  if (found->border.empty()) return;
  found->near_border = NearBorder(found->border, masks.labels.size());
  found->fit = Fit(*found, *found);
  const auto index = static_cast<size_t>(found - frames_.begin());
  for (size_t k = 0; k < frames_.size(); ++k) Compare(*found, index, k);
}

std::optional<Diagnostic> MaskImageCheck::FindShift() const {
  int best_shift = 0;
  double best_gain = kMinGain;
  for (const auto& [shift, counts] : shifts_) {
    if (counts.masks < kMinMasks || counts.better < kMinBetter * counts.masks) continue;
    if (counts.fit <= best_gain * counts.own_fit) continue;
    best_gain = counts.fit / counts.own_fit;
    best_shift = shift;
  }
  if (best_shift == 0) return std::nullopt;
  std::vector<double> intervals_s;
  for (const int64_t interval_ns : intervals_ns_) intervals_s.push_back(1e-9 * static_cast<double>(interval_ns));
  const double offset_s = std::abs(best_shift) * Median(std::move(intervals_s));
  return Diagnostic{
      .code = "masks_displaced",
      .severity = Severity::kWarning,
      .text = fmt::format("the masks fit the images of other frames: their borders lie on edges of the image {} frames "
                          "{} ({:.2f} s), {:.0f} % stronger than on those of their own frame",
                          std::abs(best_shift), best_shift < 0 ? "before" : "after", offset_s, 100 * (best_gain - 1)),
      .advice = fmt::format("{} {:.3f} s {} the timestamps of the masks, or stamp each mask with the time of its image",
                            best_shift < 0 ? "subtract" : "add", offset_s, best_shift < 0 ? "from" : "to")};
}

std::optional<Diagnostic> MaskImageCheck::Check() const {
  if (auto shift = FindShift()) return shift;
  Verdict verdict = concluded_;
  for (const Frame& frame : frames_) verdict.Add(frame);
  const bool masks_move = verdict.overlap < kMaxOverlap * verdict.masks;
  if (!masks_move || verdict.masks < kMinJudgedMasks || verdict.fitting > kMaxFittingShare * verdict.masks) {
    return std::nullopt;
  }
  return Diagnostic{
      .code = "masks_contradict_images",
      .severity = Severity::kWarning,
      .text = fmt::format("the masks do not fit the images: the borders of {:.0f} % of them lie on stronger edges in "
                          "their own image than in other images, and half of them would by chance",
                          100 * verdict.fitting / verdict.masks),
      .advice = "check whether the masks were made from these images, and whether both lists have the same order"};
}

}  // namespace romap::masks
