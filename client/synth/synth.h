#pragma once

#include <functional>
#include <string>

#include "client/synth/options.h"
#include "common/status.h"

namespace romap::synth {

// Renders a synthetic sequence with exact ground truth: textured objects on a table in a room, recorded by a moving
// camera. Writes the files that Sequence::Open() reads to `dir` (created if missing; its parent must exist):
//
//   rgb/ rgb.txt             color images, PNG or JPEG
//   mask/ mask.txt           8-bit labels, exact at pixel centers unless mask faults are enabled
//   detections.csv           timestamp,label,class,score: class of each label in each frame
//   depth/ depth.txt         16-bit z depth
//   groundtruth.txt          camera to world, TUM format, meters, z up
//   camera.yaml objects.yaml intrinsics; tight cuboids
//   gt/<name>.ply            points on the surface, about 1 mm apart, with `seen` (1: visible in some frame) and
//   `source`
//                            (2: on the side the object stands on, otherwise 0)
//   gt_mesh/<name>.ply       the exact triangles; parts are closed and may overlap
//
// Cut frames are in no list, but the later frames keep their numbers and timestamps. A frame that repeats the previous
// image lists the files and the pose of that image. Frames are written as they are rendered, so memory does not grow
// with their number. The output is identical for any number of threads. `progress` (may be empty) is called from any
// thread, one call at a time, with the number of finished frames and of all frames. INVALID_ARGUMENT names all invalid
// options. Otherwise as WriteFile.
absl::Status MakeSequence(const SynthOptions& options, const std::string& dir,
                          const std::function<void(int done, int total)>& progress = {});

}  // namespace romap::synth
