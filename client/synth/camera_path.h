#pragma once

#include <vector>

#include "client/synth/options.h"
#include "client/synth/scene.h"
#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap::synth {

inline constexpr double kTwoRoundsRoomHalf_m = 3.2;

// The camera of a sequence, principal point in the middle. The focal length is 0.9 * width for the pinhole; a lens,
// with coefficients as they are found in calibrations, sees more: 0.6 * width (radial-tangential) or 0.45 * width
// (fisheye).
CameraModel SynthCamera(const SynthOptions& options);

// One camera pose per frame, inside the room. Orbit and hand look at the objects from a distance that fits them into
// the image; two rounds want a room of at least kTwoRoundsRoomHalf_m.
std::vector<SE3<World, Camera>> MakeCameraPath(const SynthOptions& options, const Scene& scene,
                                               const CameraModel& camera);

}  // namespace romap::synth
