#pragma once

#include <vector>

#include "client/synth/options.h"
#include "client/synth/scene.h"
#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap::synth {

inline constexpr double kTwoRoundsRoomHalf_m = 3.2;

// The camera of a sequence, with the principal point at the image center and realistic distortion. The focal length is
// 0.9 * width (pinhole), 0.6 * width (radial-tangential) or 0.45 * width (fisheye).
CameraModel SynthCamera(const SynthOptions& options);

// One camera pose per frame, inside the room. kOrbit and kHandheld view the objects from a distance at which they fit
// into the image. kTwoRounds requires a room of at least kTwoRoundsRoomHalf_m.
std::vector<SE3<World, Camera>> MakeCameraPath(const SynthOptions& options, const Scene& scene,
                                               const CameraModel& camera);

}  // namespace romap::synth
