#include "client/doctor/mask_time_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <opencv2/imgproc.hpp>

#include "common/statistics.h"

namespace romap::doctor {
namespace {

constexpr size_t kMaxBorderPixels = 2000;
constexpr size_t kMinBorderPixels = 50;
constexpr int kMaxShift = 25;      // frames
constexpr int kMinMasks = 12;      // that have an image at the shift
constexpr double kMinGain = 1.15;  // of the fit at the best shift over that without
constexpr double kMinShare = 0.8;  // of the masks fit better at the best shift

std::vector<cv::Point> BorderOf(const cv::Mat& labels) {
  std::vector<cv::Point> border;
  if (labels.empty()) return border;
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

cv::Mat EdgesOf(const cv::Mat& image_bgr) {
  cv::Mat gray, dx, dy, edges;
  cv::cvtColor(image_bgr, gray, cv::COLOR_BGR2GRAY);
  cv::Sobel(gray, dx, CV_32F, 1, 0);
  cv::Sobel(gray, dy, CV_32F, 0, 1);
  cv::magnitude(dx, dy, edges);
  cv::GaussianBlur(edges, edges, {5, 5}, 0);
  const double mean = cv::mean(edges)[0];
  return mean > 0 ? cv::Mat(edges / mean) : edges;
}

}  // namespace

void MaskTimeCheck::Add(int64_t timestamp_ns, const cv::Mat& image_bgr, const cv::Mat& labels) {
  frames_.push_back({timestamp_ns, EdgesOf(image_bgr), BorderOf(labels)});
}

double MaskTimeCheck::Fit(size_t mask, size_t image) const {
  double sum = 0;
  for (const cv::Point& pixel : frames_[mask].border) sum += frames_[image].edges.at<float>(pixel);
  return sum / static_cast<double>(frames_[mask].border.size());
}

std::optional<Diagnostic> MaskTimeCheck::Check() const {
  int best_shift = 0;
  double best_gain = 1, best_share = 0;
  for (int shift = -kMaxShift; shift <= kMaxShift; ++shift) {
    int masks = 0, better = 0;
    double moved = 0, as_given = 0;
    for (size_t k = 0; k < frames_.size(); ++k) {
      const auto image = static_cast<int64_t>(k) + shift;
      if (image < 0 || image >= static_cast<int64_t>(frames_.size())) continue;
      if (frames_[k].border.size() < kMinBorderPixels) continue;
      if (frames_[k].edges.size() != frames_[static_cast<size_t>(image)].edges.size()) continue;
      const double fit = Fit(k, static_cast<size_t>(image)), given_fit = Fit(k, k);
      ++masks;
      better += fit > given_fit ? 1 : 0;
      moved += fit;
      as_given += given_fit;
    }
    if (masks < kMinMasks || moved <= best_gain * as_given) continue;
    best_gain = moved / as_given;
    best_shift = shift;
    best_share = static_cast<double>(better) / masks;
  }
  if (best_shift == 0 || best_gain < kMinGain || best_share < kMinShare) return std::nullopt;
  std::vector<double> steps_s;
  for (size_t k = 1; k < frames_.size(); ++k) {
    steps_s.push_back(1e-9 * static_cast<double>(frames_[k].timestamp_ns - frames_[k - 1].timestamp_ns));
  }
  const double offset_s = std::abs(best_shift) * Median(std::move(steps_s));
  return Diagnostic{
      .code = "masks_displaced",
      .severity = Severity::kWarning,
      .text = fmt::format("the masks fit the images of other frames: their borders lie on edges of the image {} frames "
                          "{} ({:.2f} s), {:.0f} % stronger than on those of their own frame",
                          std::abs(best_shift), best_shift < 0 ? "before" : "after", offset_s, 100 * (best_gain - 1)),
      .advice = fmt::format("{} {:.3f} s {} the timestamps of mask.txt, or stamp each mask with the time of its image",
                            best_shift < 0 ? "subtract" : "add", offset_s, best_shift < 0 ? "from" : "to")};
}

}  // namespace romap::doctor
