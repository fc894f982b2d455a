#include "client/files/mapped_frames.h"

#include <unordered_map>

namespace romap::files {

std::vector<PosedFrame> MappedFrames(const Sequence& sequence, const std::vector<StampedPose>& trajectory) {
  std::unordered_map<int64_t, const StampedPose*> pose_at;
  for (const StampedPose& pose : trajectory) pose_at[pose.timestamp_ns] = &pose;
  std::vector<PosedFrame> frames;
  for (size_t i = 0; i < sequence.size(); ++i) {
    const auto it = pose_at.find(sequence.timestamp_ns(i));
    if (it != pose_at.end()) frames.push_back({i, it->second->T_world_camera});
  }
  return frames;
}

}  // namespace romap::files
