#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace romap::masks {

// The pixels with one label, measured in a thumbnail.
struct MaskRegion {
  uint16_t label = 0;
  int area = 0;     // thumbnail pixels
  cv::Rect box;     // the same, tight
  int sides = 0;    // number of image sides that it touches over at least kMinSideShare of their length
  int outline = 0;  // pairs of neighboring pixels, one in the region and one outside; not with kIgnoreLabel
  std::map<uint16_t, int> contacts;  // of these, by the label of the pixel outside; 0 = background
};

// A small copy of a label image and of its frame, for comparisons between frames that cost little.
struct MaskThumbnail {
  cv::Mat labels;                   // CV_16UC1
  cv::Mat gray;                     // CV_8UC1, same size, averaged; empty if the image is not known
  int stride_px = 1;                // pixels of the frame per thumbnail pixel
  std::vector<MaskRegion> regions;  // of all labels but 0 and kIgnoreLabel, by label

  const MaskRegion* Find(uint16_t label) const;
  int pixels() const { return labels.rows * labels.cols; }
};

inline constexpr double kMinSideShare = 0.1;  // of the length of an image side

// `labels`: CV_16UC1, not empty. `gray`: of MakeGray() for an image of the same size; may be empty.
MaskThumbnail MakeThumbnail(const cv::Mat& labels, const cv::Mat& gray);

// The gray values of a thumbnail. `image_bgr`: CV_8UC3.
cv::Mat MakeGray(const cv::Mat& image_bgr);

// Intersection over union of the pixels with label `a` in one thumbnail and label `b` in another of the same size.
double MaskIou(const MaskThumbnail& first, uint16_t a, const MaskThumbnail& second, uint16_t b);

}  // namespace romap::masks
