#include "client/importers/mask_layers.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "client/files/image_file.h"
#include "client/importers/any_image.h"
#include "common/label_png.h"

namespace romap::importers {
namespace {

// Some programs write masks with three equal channels.
absl::StatusOr<cv::Mat> DecodeGrayLabels(const std::string& path, const std::string& bytes) {
  const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
  cv::Mat image;
  try {
    image = cv::imdecode(raw, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
  }
  if (image.empty()) return InvalidArgument("{}: not a mask that can be read", path);
  if (image.channels() == 1) return image;
  std::vector<cv::Mat> channels;
  cv::split(image, channels);
  if (cv::countNonZero(channels[0] != channels[1]) > 0 || cv::countNonZero(channels[0] != channels[2]) > 0) {
    return InvalidArgument("{}: the mask has colors; expected a PNG with one channel (gray or palette)", path);
  }
  return channels[0];
}

}  // namespace

EncodedMasks EncodeLayers(const std::vector<MaskLayer>& layers, cv::Size size_px) {
  std::vector<size_t> order(layers.size());
  std::iota(order.begin(), order.end(), 0);
  std::vector<int> area_px;
  for (const MaskLayer& layer : layers) area_px.push_back(cv::countNonZero(layer.pixels));
  std::ranges::stable_sort(order, [&](size_t a, size_t b) { return area_px[a] > area_px[b]; });
  cv::Mat labels(layers.empty() ? size_px : layers.front().pixels.size(), CV_16UC1, cv::Scalar(0));
  EncodedMasks masks{.mask_encoding = MaskEncoding::kLabelPng, .label_png = {}, .label_runs = {}, .instances = {}};
  for (const size_t k : order) labels.setTo(static_cast<int>(k) + 1, layers[k].pixels);
  for (size_t k = 0; k < layers.size(); ++k) {
    masks.instances.push_back({.label = static_cast<uint32_t>(k) + 1,
                               .class_name = layers[k].class_name,
                               .score = layers[k].score,
                               .track_id = {}});
  }
  masks.label_png = EncodeLabelImage(labels);
  return masks;
}

std::string EncodeLabelImage(const cv::Mat& labels) {
  double largest = 0;
  cv::minMaxLoc(labels, nullptr, &largest);
  if (largest >= 255) return EncodePng(labels);  // the value 255 of 8 bits may mean "unknown"
  cv::Mat bytes;
  labels.convertTo(bytes, CV_8U);
  return EncodePng(bytes);
}

absl::StatusOr<cv::Mat> ReadLabels(const std::string& path, cv::Size size_px) {
  ROMAP_ASSIGN_OR_RETURN(const std::string png, files::ReadPngFile(path));
  absl::StatusOr<cv::Mat> labels = DecodeLabelPng(png);
  if (!labels.ok()) labels = DecodeGrayLabels(path, png);
  if (!labels.ok()) return labels;
  if (labels->type() != CV_16UC1) labels->convertTo(*labels, CV_16U);
  return size_px.empty() || labels->size() == size_px ? *labels : ResizeNearest(*labels, size_px);
}

cv::Mat ResizeNearest(const cv::Mat& image, cv::Size size_px) {
  cv::Mat resized;
  cv::resize(image, resized, size_px, 0, 0, cv::INTER_NEAREST_EXACT);
  return resized;
}

cv::Mat FillPolygon(const std::vector<double>& xy_px, cv::Size size_px) {
  cv::Mat mask(size_px, CV_8UC1, cv::Scalar(0));
  const size_t corners = xy_px.size() / 2;
  std::vector<double> crossings;
  for (int row = 0; row < size_px.height; ++row) {
    const double y = row + 0.5;
    crossings.clear();
    for (size_t k = 0; k < corners; ++k) {
      const double *a = &xy_px[2 * k], *b = &xy_px[2 * ((k + 1) % corners)];
      if ((a[1] <= y) == (b[1] <= y)) continue;
      crossings.push_back(a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
    }
    std::ranges::sort(crossings);
    for (size_t k = 0; k + 1 < crossings.size(); k += 2) {
      const auto column = [&](double x) {
        return static_cast<int>(std::ceil(std::clamp(x - 0.5, 0.0, static_cast<double>(size_px.width))));
      };
      const int first = column(crossings[k]), end = column(crossings[k + 1]);
      if (first < end) mask.row(row).colRange(first, end).setTo(255);
    }
  }
  return mask;
}

}  // namespace romap::importers
