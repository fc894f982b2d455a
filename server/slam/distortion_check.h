#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "common/camera_model.h"
#include "common/diagnostic.h"
#include "server/slam/pose_check.h"

namespace romap::slam {

// Checks the stated lens distortion against given poses that agree with the images: images that were undistorted before
// they were sent, with the coefficients of the original camera, are a common mistake. The distortion is contradicted if
// the matches are clearly nearer to their epipolar lines without it, in nearly all of several pairs.
class DistortionCheck {
 public:
  // `source_camera`: with its distortion; the matches of the pair are pixels of source_camera.Pinhole().
  void AddPair(const CameraModel& source_camera, const PoseCheck::AgreeingPair& pair);

  bool IsContradicted() const { return contradicted_since_frame_ != 0; }
  // The first frame of the pairs that contradict it; 0: it is not contradicted.
  uint64_t contradicted_since_frame() const { return contradicted_since_frame_; }
  // Whether the images fit a little better without it, so that it is the first to check if the camera is contradicted.
  bool IsSuspect() const;
  // What to say if it is contradicted or suspect. nullopt: there is no pair.
  std::optional<Diagnostic> Check() const;

 private:
  // Median distances of the matches from their epipolar lines, as a share of the image width.
  struct Pair {
    uint64_t first_frame_id = 0;
    double with = 0;  // the stated distortion
    double without = 0;
  };

  bool PairsContradict() const;
  double MedianOf_px(double Pair::*distance) const;

  CameraModel camera_;
  std::deque<Pair> pairs_;  // the newest ones
  bool has_older_pairs_ = false;
  uint64_t contradicted_since_frame_ = 0;
};

}  // namespace romap::slam
