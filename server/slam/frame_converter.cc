#include "server/slam/frame_converter.h"

namespace romap::slam {
namespace {

constexpr size_t kMaxFramesWithoutMasks = 512;  // 17 s at 30 frames/s, longer than any detector takes

}  // namespace

void FrameConverter::Convert(const RollingShutter& shutter, TrackedFrame& tracked) {
  const Frame& frame = *tracked.frame;
  if (!frame.has_masks) {
    without_masks_.push_back({frame.frame_id, shutter});
    if (without_masks_.size() > kMaxFramesWithoutMasks) without_masks_.pop_front();
  }
  tracked.frame = shutter.Convert(frame, /*with_image=*/tracked.is_keyframe);
}

FrameMasks FrameConverter::ConvertMasks(const FrameMasks& masks) const {
  FrameMasks converted = masks;
  for (const FrameShutter& frame : without_masks_) {
    if (frame.frame_id == masks.frame_id) converted.labels = frame.shutter.ConvertLabels(masks.labels);
  }
  return converted;
}

}  // namespace romap::slam
