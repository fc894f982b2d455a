#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "common/pose_uncertainty.h"

namespace romap::session {

// The sources of a frame's uncertainty, in current map units.
struct FrameUncertainty {
  PoseUncertainty reference;  // of its reference keyframe
  PoseUncertainty relative;   // of the frame relative to it
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();
};

// The uncertainties of the frames after their whole trajectory is aligned. The errors relative to the keyframes are
// alike in neighboring frames, so they also move the alignment, and with it all frames: by half their root mean square,
// as the mean of four independent errors. This matters live, where a few frames may have large errors. Errors of the
// positions also turn the alignment about the line that the positions are closest to.
std::vector<PoseUncertainty> AlignedUncertainties(std::span<const FrameUncertainty> frames);

}  // namespace romap::session
