#pragma once

#include <span>
#include <string>

#include "client/eval/alignment.h"
#include "client/eval/run_record.h"
#include "client/files/tum.h"

namespace romap::eval {

// How the world of a map is aligned with the ground-truth world, and why.
struct MapAlignment {
  Alignment alignment = Alignment::kSim3;
  std::string reason = {};
};

// Whether the worlds of two trajectories are the same: most positions and orientations agree without alignment.
bool HaveSameWorld(std::span<const files::StampedPose> estimated, std::span<const files::StampedPose> ground_truth,
                   double max_dt_s);

// Determines the alignment of the output of `romap run` in out_dir. If the record has the use of poses: none for given
// poses, Sim3 for estimated ones. Otherwise: none if the trajectories have the same world, Sim3 if not or if they
// cannot be read.
MapAlignment DetermineAlignment(const RunRecord& record, const std::string& out_dir, const std::string& sequence_dir);

}  // namespace romap::eval
