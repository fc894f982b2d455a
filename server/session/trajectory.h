#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <unordered_map>
#include <vector>

#include "common/scaled_pose.h"
#include "common/stage_messages.h"

namespace romap::session {

// The poses of all tracked frames in the current world. Keyframes have the poses that mapping gave them. Any other
// frame moves with the keyframe that it was tracked against. That pose was found before mapping adjusted the keyframes
// around it, so the frame also gets its share, by time, of the correction that the next keyframe with the same
// reference got. Not thread-safe.
class Trajectory {
 public:
  // Adds a tracked frame, in the order of time. `reference`, `T_reference_camera`: see TrackedFrame.
  void Add(uint64_t frame_id, int64_t timestamp_ns, const SE3<World, Camera>& T_world_camera, KeyframeId reference,
           const SE3<Camera, Camera>& T_reference_camera);
  // A frame, added or not, became a keyframe, with this pose. In the order of time.
  void SetKeyframe(uint64_t frame_id, int64_t timestamp_ns, KeyframeId keyframe,
                   const SE3<World, Camera>& T_world_camera);
  void Correct(const MapCorrection& correction);

  // In the order of Add().
  std::vector<SE3<World, Camera>> Poses() const;

 private:
  struct TrajectoryFrame {
    int64_t timestamp_ns = 0;
    SE3<World, Camera> T_world_camera;  // as tracked
    KeyframeId reference;
    SE3<Camera, Camera> T_reference_camera;
    KeyframeId keyframe = {};  // 0 = not a keyframe
  };
  // The correction of a frame's pose relative to its reference: T_reference_camera * T_camera_corrected.
  struct RelativeCorrection {
    int64_t timestamp_ns = 0;
    SE3<Camera, Camera> T_camera_corrected;
  };
  using RelativeCorrections = std::unordered_map<KeyframeId, std::vector<RelativeCorrection>>;  // by reference

  RelativeCorrections CorrectionsOfKeyframes() const;
  static SE3<Camera, Camera> Interpolate(const std::vector<RelativeCorrection>& corrections, int64_t timestamp_ns);

  std::vector<TrajectoryFrame> frames_;
  std::unordered_map<uint64_t, size_t> index_of_frame_;
  std::map<KeyframeId, ScaledPose> keyframes_;
  std::map<KeyframeId, int64_t> keyframe_timestamps_ns_;
};

}  // namespace romap::session
