#pragma once

#include <Eigen/Core>
#include <cmath>
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

  Eigen::Vector2d BoxCenter() const {
    return {box_px.x + (box_px.width - 1) / 2.0, box_px.y + (box_px.height - 1) / 2.0};
  }
  double BoxDiagonal() const { return std::hypot(box_px.width, box_px.height); }
  // The object goes on outside the image: its box and centre mean little.
  bool CutByBorder() const { return border_px > 0.04 * 2 * (box_px.width + box_px.height); }
};

// The masks of a frame that are neither specks nor cover the image, by label. Empty when there are none or when the
// label image does not fit the frame.
std::vector<Detection> ExtractDetections(const Frame& frame, const ObjectsConfig& config);

}  // namespace romap::objects
