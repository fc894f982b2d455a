#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "server/masks/mask_thumbnail.h"

namespace romap::masks {

// Finds masks that keep their place in the image while the scene behind them moves: a gripper, a hand, the hood of a
// rover. They reach the border of the image, because what holds the camera is not in it. An object in the middle of the
// image may keep its place too while the camera moves around it, but does not touch the border.
class SceneMotion {
 public:
  // Takes the next frame. Returns the labels of `thumbnail` that have moved with the camera.
  std::vector<uint16_t> FindCameraFixed(const MaskThumbnail& thumbnail);

 private:
  std::deque<MaskThumbnail> references_;  // oldest first; the scene moved between any two in a row
};

}  // namespace romap::masks
