#include "client/cli/mapped_frames.h"

#include <unordered_map>

namespace romap::cli {

std::vector<PosedFrame> MappedFrames(const files::Sequence& sequence,
                                     const std::vector<files::StampedPose>& trajectory) {
  std::unordered_map<int64_t, const files::StampedPose*> pose_at;
  for (const files::StampedPose& pose : trajectory) pose_at[pose.timestamp_ns] = &pose;
  std::vector<PosedFrame> frames;
  for (size_t i = 0; i < sequence.size(); ++i) {
    const auto it = pose_at.find(sequence.timestamp_ns(i));
    if (it != pose_at.end()) frames.push_back({i, it->second->T_world_camera});
  }
  return frames;
}

}  // namespace romap::cli
