#pragma once

#include <vector>

#include "client/synth/camera_path.h"
#include "client/synth/image_poses.h"
#include "client/synth/options.h"
#include "common/camera_model.h"

namespace romap::synth {

// The poses of the camera during image `frame`, at the middle of the exposure of each row. The middle row has the pose
// of path.Pose(frame).
ImagePoses PosesOfImage(const CameraPath& path, const CameraModel& camera, const SynthOptions& options, int frame);

// The poses at evenly spaced moments of the exposure, about one per 1.5 pixels of image motion and at most 16. Empty if
// the image does not move during the exposure. `depth_m` is the typical depth of the scene.
std::vector<ImagePoses> PosesDuringExposure(const CameraPath& path, const CameraModel& camera,
                                            const SynthOptions& options, int frame, double depth_m);

}  // namespace romap::synth
