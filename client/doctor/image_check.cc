#include "client/doctor/image_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <string>

#include "common/image_sharpness.h"
#include "common/statistics.h"

namespace romap::doctor {
namespace {

constexpr double kBlurredShare = 0.25;  // of the median sharpness: much less than its neighbors
constexpr double kSaturated = 0.3;      // share of the pixels
constexpr double kBlack = 0.6;          // share of the pixels
constexpr double kMinContrast = 4;      // gray levels
constexpr double kFewFrames = 0.1;      // share of the frames up to which a fault is no matter
constexpr int kBrightLevel = 254;
constexpr int kDarkLevel = 4;
constexpr size_t kWindow = 15;  // frames whose sharpness is compared

double ShareOf(const cv::Mat& selected) {
  return static_cast<double>(cv::countNonZero(selected)) / static_cast<double>(selected.total());
}

}  // namespace

void ImageCheck::Add(uint64_t frame_id, const cv::Mat& image_bgr, const cv::Mat& labels) {
  cv::Mat gray;
  cv::cvtColor(image_bgr, gray, cv::COLOR_BGR2GRAY);
  cv::Scalar mean, deviation;
  cv::meanStdDev(gray, mean, deviation);
  Measured frame{.frame_id = frame_id,
                 .sharpness = ImageSharpness(image_bgr),
                 .bright_share = ShareOf(gray >= kBrightLevel),
                 .dark_share = ShareOf(gray <= kDarkLevel),
                 .contrast = deviation[0],
                 .repeats_last = last_.size() == gray.size() && cv::norm(last_, gray, cv::NORM_INF) == 0,
                 .has_masks = !labels.empty(),
                 .has_labels = !labels.empty() && cv::countNonZero(labels) > 0};
  last_ = gray;
  frames_.push_back(frame);
}

std::vector<Diagnostic> ImageCheck::Diagnostics() const {
  std::vector<Diagnostic> found;
  const auto add = [&](const char* code, const std::function<bool(size_t)>& is_faulty, const std::string& what,
                       const char* advice) {
    uint64_t count = 0, first = 0;
    for (size_t i = 0; i < frames_.size(); ++i) {
      if (!is_faulty(i)) continue;
      if (count++ == 0) first = frames_[i].frame_id;
    }
    if (static_cast<double>(count) <= kFewFrames * static_cast<double>(frames_.size())) return;
    found.push_back({.code = code,
                     .severity = Severity::kWarning,
                     .first_frame_id = first,
                     .count = count,
                     .text = fmt::format("{} of {} images checked {}", count, frames_.size(), what),
                     .advice = advice});
  };
  const auto is_blurred = [&](size_t i) {
    std::vector<double> around;
    for (size_t k = i < kWindow ? 0 : i - kWindow; k < std::min(frames_.size(), i + kWindow + 1); ++k) {
      around.push_back(frames_[k].sharpness);
    }
    return frames_[i].sharpness < kBlurredShare * Median(std::move(around));
  };
  add("images_blurred", is_blurred, "are much more blurred than those around them",
      "move the camera more slowly, or use a shorter exposure");
  add(
      "images_overexposed", [&](size_t i) { return frames_[i].bright_share > kSaturated; },
      "are overexposed in more than 30 % of their pixels", "reduce the exposure");
  add(
      "images_dark", [&](size_t i) { return frames_[i].dark_share > kBlack; },
      "are black in more than 60 % of their pixels", "increase the exposure, or check the bit depth");
  add(
      "images_without_texture", [&](size_t i) { return frames_[i].contrast < kMinContrast; },
      "show hardly any contrast", "check that the images are decoded rightly, and that the lens is not covered");
  add(
      "images_repeated", [&](size_t i) { return frames_[i].repeats_last; }, "repeat the image before them",
      "record each frame once");
  const bool any_masks = std::any_of(frames_.begin(), frames_.end(), [](const Measured& f) { return f.has_masks; });
  const bool any_labels = std::any_of(frames_.begin(), frames_.end(), [](const Measured& f) { return f.has_labels; });
  if (any_masks && !any_labels) {
    found.push_back({.code = "masks_empty",
                     .severity = Severity::kError,
                     .text = "no mask has a pixel with a label, so no object can be mapped",
                     .advice = "check the mask files: 0 is background, other values are labels"});
  }
  if (!any_masks) {
    found.push_back({.code = "masks_missing",
                     .severity = Severity::kError,
                     .text = "no frame has a mask, so no object can be mapped",
                     .advice = "add mask.txt, or name the list with --masks"});
  }
  return found;
}

}  // namespace romap::doctor
