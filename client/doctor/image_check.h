#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "common/diagnostic.h"

namespace romap::doctor {

// Measures blur, exposure and repetition of the images of a recording, and how its masks cover them.
class ImageCheck {
 public:
  // `image_bgr`: CV_8UC3. `labels`: CV_16UC1; empty: the frame has no masks.
  void Add(uint64_t frame_id, const cv::Mat& image_bgr, const cv::Mat& labels);

  // Codes: images_blurred, images_overexposed, images_dark, images_without_texture, images_repeated, masks_empty,
  // masks_missing.
  std::vector<Diagnostic> Diagnostics() const;

 private:
  struct Measured {
    uint64_t frame_id = 0;
    double sharpness = 0;     // see ImageSharpness
    double bright_share = 0;  // of the pixels: saturated
    double dark_share = 0;    // of the pixels: black
    double contrast = 0;      // standard deviation of the gray values
    bool repeats_last = false;
    bool has_masks = false;
    bool has_labels = false;
  };

  std::vector<Measured> frames_;
  cv::Mat last_;  // small gray image of the last frame
};

}  // namespace romap::doctor
