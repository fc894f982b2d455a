#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace romap::objects {

// A straight edge in an image. Pixels of the whole pinhole image, pixel centers at integer coordinates.
struct LineSegment {
  Eigen::Vector2d from_px;
  Eigen::Vector2d to_px;

  double Length_px() const { return (to_px - from_px).norm(); }
};

struct LineSegmentOptions {
  double min_length_px = 12;      // the direction of a shorter segment is too uncertain
  double min_length_share = 0.1;  // of the diagonal of the mask's box; shorter segments are texture
  int dilation_px = 3;            // the mask is dilated by this much, because masks are not exact
  double min_inside_share = 0.9;  // of a segment's length, inside the dilated mask
  size_t max_segments = 24;       // the longest ones are kept
  double max_crop_px2 = 3e4;      // larger crops are downscaled to this area to bound the time
};

// The straight edges on one dilated mask, longest first. `image_bgr` CV_8UC3, `labels` CV_16UC1 of the same size;
// `box_px` tight around the pixels of `label`. Searches only a crop around the box. Source: C. Akinlar, C. Topal,
// "EDLines: a real-time line segment detector with a false detection control", PRL 2011.
std::vector<LineSegment> FindLineSegments(const cv::Mat& image_bgr, const cv::Mat& labels, uint16_t label,
                                          const cv::Rect& box_px, const LineSegmentOptions& options = {});

}  // namespace romap::objects
