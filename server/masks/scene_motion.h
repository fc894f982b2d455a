#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "server/masks/mask_thumbnail.h"

namespace romap::masks {

// Finds what keeps its place in the image while the scene behind it moves: a gripper, a hand, the hood of a rover. With
// a mask it is found by the place of the mask, without one by its texture. Such parts reach the border of the image,
// because what holds the camera is not in it. An object in the middle of the image may keep its place too while the
// camera moves around it, but does not touch the border.
class SceneMotion {
 public:
  struct CameraFixed {
    std::vector<uint16_t> labels;  // of masks
    cv::Mat region;                // CV_8UC1 of the thumbnail's size, nonzero in parts of any label; empty: none
  };

  // Takes the next frame. Returns what has moved with the camera.
  CameraFixed Find(const MaskThumbnail& thumbnail);

 private:
  cv::Mat FindRegion(const MaskThumbnail& thumbnail) const;

  std::deque<MaskThumbnail> references_;  // oldest first; the scene moved between any two in a row
};

}  // namespace romap::masks
