#pragma once

#include <Eigen/Core>

#include "client/synth/hand_motion.h"
#include "client/synth/options.h"
#include "client/synth/scene.h"
#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap::synth {

inline constexpr double kTwoRoundsRoomHalf_m = 3.2;

// The motion of the camera inside the room. All paths except kTwoRounds view the objects from a distance at which they
// fit into the image of `camera`. kTwoRounds requires a room of at least kTwoRoundsRoomHalf_m.
class CameraPath {
 public:
  CameraPath(const SynthOptions& options, const Scene& scene, const CameraModel& camera);

  // The pose of the camera at frame 0..frames - 1, or `offset_frames` (-1..1) later. Continuous in the offset.
  SE3<World, Camera> Pose(int frame, double offset_frames = 0) const;

 private:
  // `time` in frames since the start of the path.
  SE3<World, Camera> PoseOnPath(double time) const;

  SynthOptions options_;
  double room_half_m_;
  double table_height_m_;
  double distance_m_ = 1;
  Eigen::Vector3d target_m_ = Eigen::Vector3d::Zero();
  double start_rad_ = 0;
  double sweep_rad_ = 0;     // azimuth of one pass along the arc
  int rotating_frames_ = 0;  // frames before the start of the path
  RotationBursts bursts_;
  Shake shake_;
};

}  // namespace romap::synth
