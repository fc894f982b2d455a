#pragma once

#include <cstdint>
#include <opencv2/core/types.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/stage_messages.h"
#include "server/objects/objects_config.h"

namespace romap::objects {

// One instance mask of one frame.
struct Detection {
  uint16_t label = 0;  // its value in this frame's label image
  std::string class_name;
  double score = 1;
  std::optional<uint64_t> track_id;
  int area_px = 0;
  cv::Rect box_px;    // tight around the mask
  int border_px = 0;  // mask pixels on the border of the image

  // The object extends beyond the image, so that its box does not bound it.
  bool CutByBorder() const {
    constexpr double kMaxBorderShare = 0.04;  // of the perimeter of the box: touching the border is not a cut
    return border_px > kMaxBorderShare * 2 * (box_px.width + box_px.height);
  }
};

// The masks of a frame by label, without very small and very large ones (see ObjectsConfig). Empty when the frame has
// no masks or its label image has the wrong type or size.
std::vector<Detection> ExtractDetections(const Frame& frame, const ObjectsConfig& config);

}  // namespace romap::objects
