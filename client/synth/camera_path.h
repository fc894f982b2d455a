#pragma once

#include <vector>

#include "client/synth/options.h"
#include "client/synth/scene.h"
#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap::synth {

inline constexpr double kTwoRoundsRoomHalf_m = 3.2;

// The pinhole camera of a sequence: focal length 0.9 * width, principal point in the middle, no distortion.
CameraModel SynthCamera(const SynthOptions& options);

// One camera pose per frame, inside the room. Orbit and hand look at the objects from a distance that fits them into
// the image; two rounds want a room of at least kTwoRoundsRoomHalf_m.
std::vector<SE3<World, Camera>> MakeCameraPath(const SynthOptions& options, const Scene& scene,
                                               const CameraModel& camera);

}  // namespace romap::synth
