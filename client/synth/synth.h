#pragma once

#include <functional>
#include <string>

#include "client/synth/options.h"
#include "common/status.h"

namespace romap::synth {

// Makes a sequence out of nothing: textured solids on a table in a room, seen by a moving camera, with all that is to
// be known about it. Writes into `dir` (made if missing; its parent must exist) the layout that Sequence::Open() reads:
//
//   rgb/ rgb.txt             colour, PNG or JPEG
//   mask/ mask.txt           8-bit labels, exact at pixel centres unless mask faults are asked for
//   detections.csv           timestamp,label,class,score: what the labels mean in each frame
//   depth/ depth.txt         16-bit z depth
//   groundtruth.txt          camera to world, TUM format, metres, z up
//   camera.yaml objects.yaml intrinsics; tight cuboids
//   gt/<name>.ply            points on the surface, about 1 mm apart, with `seen` (1: some frame shows it) and `source`
//                            (2: the side it stands on, else 0)
//   gt_mesh/<name>.ply       the exact triangles; parts are closed and may reach into each other
//
// A frame that is cut is in no list, but keeps its number and its time; a frame that repeats the picture before it
// lists that picture's files again and has its pose. Frames go to the disk as they are made: memory does not grow with
// images. The same options give the same bytes on any number of threads. `progress` (may be empty) is called from any
// thread, one call at a time, with frames done and frames in total. INVALID_ARGUMENT: bad options, all named; the
// folder cannot be written.
absl::Status MakeSequence(const SynthOptions& options, const std::string& dir,
                          const std::function<void(int done, int total)>& progress = {});

}  // namespace romap::synth
