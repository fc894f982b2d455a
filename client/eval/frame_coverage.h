#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace romap::eval {

// How many frames of a run have an estimated pose.
struct FrameCoverage {
  size_t frames = 0;
  size_t tracked = 0;       // with a pose
  size_t before_first = 0;  // before the first pose, when the map was not initialized
  size_t lost = 0;          // without a pose after that
  bool inferred = false;    // the number of frames was inferred; see InferCoverage
  double TrackedShare() const { return frames == 0 ? 0 : static_cast<double>(tracked) / static_cast<double>(frames); }
};

// All timestamps are sorted. A frame has a pose if one is closer than half a frame period.
FrameCoverage CoverageOf(std::span<const int64_t> frames_ns, std::span<const int64_t> poses_ns);

// Without a list of frames: assumes frames with the median period of the poses over the time of the ground truth.
FrameCoverage InferCoverage(std::span<const int64_t> poses_ns, int64_t truth_first_ns, int64_t truth_last_ns);

}  // namespace romap::eval
