#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "common/client_input.h"
#include "common/status.h"

namespace romap::importers {

// The masks of one image in a foreign format.
struct NamedMasks {
  std::string image;  // the name of the image, with or without folder and extension
  std::string path;   // of the file with the masks, for messages
  std::function<absl::StatusOr<EncodedMasks>()> load = nullptr;  // labels with the size of the camera
};

// One instance in an image.
struct MaskLayer {
  cv::Mat pixels;  // CV_8UC1; not 0 = instance
  std::string class_name;
  double score = 1;
};

// One label image of all layers, with the labels 1, 2, ... in their order. Where layers overlap, the smallest one is
// visible. `size_px`: of the result, if there are no layers.
EncodedMasks EncodeLayers(const std::vector<MaskLayer>& layers, cv::Size size_px);

// Encodes a label image (CV_16UC1).
std::string EncodeLabelImage(const cv::Mat& labels);

// Reads a label PNG or an instance PNG and converts it to `size_px` if that is not empty and differs: its pixels cover
// the same field of view. CV_16UC1. INVALID_ARGUMENT names the file. Otherwise as ReadFile.
absl::StatusOr<cv::Mat> ReadLabels(const std::string& path, cv::Size size_px);

// As cv::resize() with the nearest pixel, by the centers of the pixels.
cv::Mat ResizeNearest(const cv::Mat& image, cv::Size size_px);

// The pixels whose centers are inside a polygon (even-odd rule). x and y alternate; the upper left corner of the image
// is (0, 0), so the center of the first pixel is (0.5, 0.5). CV_8UC1, 255 inside.
cv::Mat FillPolygon(const std::vector<double>& xy_px, cv::Size size_px);

}  // namespace romap::importers
