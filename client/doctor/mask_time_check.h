#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "common/diagnostic.h"

namespace romap::doctor {

// Finds masks that belong to other frames than their timestamps say, e.g. because the detector stamps its results when
// they are ready. The border of a mask lies on edges of the image it was made from, so the strength of the image edges
// there is largest for that image. The check moves all masks by the same number of frames and compares.
class MaskTimeCheck {
 public:
  // Consecutive frames. `image_bgr`: CV_8UC3. `labels`: CV_16UC1; empty: the frame has no masks.
  void Add(int64_t timestamp_ns, const cv::Mat& image_bgr, const cv::Mat& labels);

  // masks_displaced. nullopt: the masks fit best as they are, or hardly any other way fits worse.
  std::optional<Diagnostic> Check() const;

 private:
  // Mean strength of the edges of an image at the border of a mask, relative to its mean over the image.
  double Fit(size_t mask, size_t image) const;

  struct Frame {
    int64_t timestamp_ns = 0;
    cv::Mat edges;  // CV_32FC1, mean 1
    std::vector<cv::Point> border;
  };
  std::vector<Frame> frames_;
};

}  // namespace romap::doctor
