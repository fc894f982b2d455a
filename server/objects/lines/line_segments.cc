#include "server/objects/lines/line_segments.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/ximgproc/edge_drawing.hpp>

namespace romap::objects {
namespace {

// The detector smooths the image and ignores its outermost pixels.
constexpr int kDetectorBorder_px = 4;

std::vector<cv::Vec4f> DetectLines(const cv::Mat& gray, double min_length_px) {
  // A new detector for each crop: a reused one keeps tables of the previous image, so results would depend on earlier
  // images.
  const cv::Ptr<cv::ximgproc::EdgeDrawing> detector = cv::ximgproc::createEdgeDrawing();
  detector->params.EdgeDetectionOperator = cv::ximgproc::EdgeDrawing::SOBEL;
  detector->params.GradientThresholdValue = 20;
  detector->params.MinLineLength = static_cast<int>(min_length_px);
  // The validation never rejects segments of our minimum length, and OpenCV 4.6 leaks its tables.
  detector->params.NFAValidation = false;
  detector->detectEdges(gray);
  std::vector<cv::Vec4f> lines;
  detector->detectLines(lines);
  return lines;
}

// Share of a segment's length where `mask` is set, both in pixels of the crop.
double InsideShare(const cv::Mat& mask, const LineSegment& segment) {
  const int steps = std::max(1, static_cast<int>(std::ceil(segment.Length_px() / 2)));
  int inside = 0;
  for (int i = 0; i <= steps; ++i) {
    const Eigen::Vector2d p = segment.from_px + (segment.to_px - segment.from_px) * i / steps;
    const int u = std::clamp(static_cast<int>(std::lround(p.x())), 0, mask.cols - 1);
    const int v = std::clamp(static_cast<int>(std::lround(p.y())), 0, mask.rows - 1);
    inside += mask.at<uint8_t>(v, u) != 0 ? 1 : 0;
  }
  return static_cast<double>(inside) / (steps + 1);
}

// Lines of a crop in pixels of the crop, detected in a downscaled image if it is large.
std::vector<LineSegment> SegmentsOf(const cv::Mat& crop_bgr, double min_length_px, double max_crop_px2) {
  cv::Mat gray;
  cv::cvtColor(crop_bgr, gray, cv::COLOR_BGR2GRAY);
  const double shrink = std::sqrt(std::min(1.0, max_crop_px2 / static_cast<double>(gray.total())));
  if (shrink < 1) cv::resize(gray, gray, {}, shrink, shrink, cv::INTER_AREA);
  // Per axis, because the size of the downscaled image is rounded.
  const Eigen::Array2d grow(static_cast<double>(crop_bgr.cols) / gray.cols,
                            static_cast<double>(crop_bgr.rows) / gray.rows);
  const auto to_crop = [&](float u, float v) -> Eigen::Vector2d { return (Eigen::Array2d(u, v) + 0.5) * grow - 0.5; };
  std::vector<LineSegment> segments;
  for (const cv::Vec4f& line : DetectLines(gray, min_length_px * shrink)) {
    segments.push_back({to_crop(line[0], line[1]), to_crop(line[2], line[3])});
  }
  return segments;
}

}  // namespace

std::vector<LineSegment> FindLineSegments(const cv::Mat& image_bgr, const cv::Mat& labels, uint16_t label,
                                          const cv::Rect& box_px, const LineSegmentOptions& options) {
  const int margin_px = options.dilation_px + kDetectorBorder_px;
  const cv::Rect wide(box_px.x - margin_px, box_px.y - margin_px, box_px.width + 2 * margin_px,
                      box_px.height + 2 * margin_px);
  const cv::Rect crop = wide & cv::Rect({}, image_bgr.size());
  const double min_length_px =
      std::max(options.min_length_px, options.min_length_share * std::hypot(box_px.width, box_px.height));
  if (std::min(crop.width, crop.height) <= 2 * kDetectorBorder_px) return {};
  cv::Mat mask = labels(crop) == label;
  const int kernel_size_px = 2 * options.dilation_px + 1;
  cv::dilate(mask, mask, cv::getStructuringElement(cv::MORPH_RECT, {kernel_size_px, kernel_size_px}));

  std::vector<LineSegment> segments = SegmentsOf(image_bgr(crop), min_length_px, options.max_crop_px2);
  std::erase_if(segments, [&](const LineSegment& segment) {
    return segment.Length_px() < min_length_px || InsideShare(mask, segment) < options.min_inside_share;
  });
  std::stable_sort(segments.begin(), segments.end(),
                   [](const LineSegment& a, const LineSegment& b) { return a.Length_px() > b.Length_px(); });
  if (segments.size() > options.max_segments) segments.resize(options.max_segments);
  const Eigen::Vector2d corner_px(crop.x, crop.y);
  for (LineSegment& segment : segments) segment = {segment.from_px + corner_px, segment.to_px + corner_px};
  return segments;
}

}  // namespace romap::objects
