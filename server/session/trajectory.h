#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <unordered_map>
#include <vector>

#include "common/pose_uncertainty.h"
#include "common/scaled_pose.h"
#include "common/stage_messages.h"
#include "server/session/trajectory_uncertainty.h"

namespace romap::session {

// The poses of all tracked frames in the current world. Keyframes have the poses that mapping gave them. Any other
// frame moves with the keyframe that it was tracked against. That pose was found before mapping adjusted the keyframes
// around it, so the frame also gets its share, by time, of the correction that the next keyframe with the same
// reference got. Not thread-safe.
class Trajectory {
 public:
  struct TrackedPose {
    uint64_t frame_id = 0;
    int64_t timestamp_ns = 0;
    SE3<World, Camera> T_world_camera;
    // See TrackedFrame.
    KeyframeId reference = {};
    SE3<Camera, Camera> T_reference_camera = {};
    std::optional<PoseUncertainty> uncertainty = {};
    PoseUncertainty reference_uncertainty = {};
  };

  // Adds a tracked frame, in the order of time.
  void Add(const TrackedPose& tracked);
  // A frame, added or not, became a keyframe, with this pose. In the order of time.
  void SetKeyframe(uint64_t frame_id, int64_t timestamp_ns, KeyframeId keyframe,
                   const SE3<World, Camera>& T_world_camera);
  void Correct(const MapCorrection& correction);

  // In the order of Add().
  std::vector<SE3<World, Camera>> Poses() const;
  // In the same order. nullopt: the frame was added without.
  std::vector<std::optional<PoseUncertainty>> Uncertainties() const;

 private:
  // The correction of a frame's pose relative to its reference: T_reference_camera * T_camera_corrected.
  struct RelativeCorrection {
    int64_t timestamp_ns = 0;
    SE3<Camera, Camera> T_camera_corrected;
  };
  using RelativeCorrections = std::unordered_map<KeyframeId, std::vector<RelativeCorrection>>;  // by reference

  RelativeCorrections CorrectionsOfKeyframes() const;
  static SE3<Camera, Camera> Interpolate(const std::vector<RelativeCorrection>& corrections, int64_t timestamp_ns);
  FrameUncertainty CurrentUncertainty(const TrackedPose& frame) const;

  std::vector<TrackedPose> frames_;
  std::unordered_map<uint64_t, KeyframeId> keyframe_of_frame_;
  std::map<KeyframeId, ScaledPose> keyframes_;
  std::map<KeyframeId, int64_t> keyframe_timestamps_ns_;
  std::map<KeyframeId, PoseUncertainty> uncertainties_;  // of keyframes, as of the newest correction
};

}  // namespace romap::session
