#pragma once

#include <cstdint>

#include "common/client_input.h"
#include "tests/support/synthetic_world.h"

namespace romap::testing_support {

// Frame `index` of the world as a client sends it, with its pose and masks. Its id is index + 1, the frames are 40 ms
// apart.
inline FrameInput MakeWorldInput(const SyntheticWorld& world, int index) {
  const TrackedFrame tracked = world.MakeFrame(index);
  const Frame& frame = *tracked.frame;
  FrameInput input;
  input.frame_id = static_cast<uint64_t>(index) + 1;
  input.timestamp_ns = int64_t{40'000'000} * (index + 1);
  input.image_encoding = ImageEncoding::kRawBgr8;
  input.raw_width_px = frame.image_bgr.cols;
  input.raw_height_px = frame.image_bgr.rows;
  for (int y = 0; y < frame.image_bgr.rows; ++y) {
    input.image.append(frame.image_bgr.ptr<char>(y), static_cast<size_t>(frame.image_bgr.cols) * 3);
  }
  input.T_world_camera = tracked.T_world_camera;
  input.mask_encoding = MaskEncoding::kRunLength;
  for (int y = 0; y < frame.labels.rows; ++y) {
    for (int x = 0; x < frame.labels.cols; ++x) {
      const uint32_t label = frame.labels.at<uint16_t>(y, x);
      std::vector<uint32_t>& runs = input.label_runs;
      if (runs.empty() || runs[runs.size() - 2] != label) runs.insert(runs.end(), {label, 0});
      ++runs.back();
    }
  }
  input.instances = frame.instances;
  return input;
}

}  // namespace romap::testing_support
