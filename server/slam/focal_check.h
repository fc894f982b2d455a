#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "common/camera_model.h"
#include "common/diagnostic.h"
#include "server/slam/pose_check.h"

namespace romap::slam {

// Checks the focal length against given poses that agree with the images by the tolerance of PoseCheck: that tolerance
// also covers a focal length of another image size, because on many paths the wrong focal length hardly moves the
// epipolar lines. It moves them systematically, though. So this check searches the factor of the focal length with
// which the matches are nearest to their epipolar lines. The focal length is contradicted if, with that factor, the
// distances are clearly smaller in nearly all of several pairs.
class FocalCheck {
 public:
  void AddPair(const CameraModel& camera, const PoseCheck::AgreeingPair& pair);

  bool IsContradicted() const { return best_.has_value(); }
  // The first frame of the pairs that contradict it; 0: it is not contradicted.
  uint64_t contradicted_since_frame() const { return contradicted_since_frame_; }
  std::optional<Diagnostic> Check() const;

 private:
  struct Pair {
    uint64_t first_frame_id = 0;
    // Median distances of the matches from their epipolar lines, as a share of the image width, by the factors of the
    // focal length.
    std::vector<double> distances;
    double log_factor = 0;  // of the least distance
  };
  struct Best {
    double factor = 1;  // median over the pairs
    double distance_px = 0;
    double given_distance_px = 0;
  };

  static std::optional<Pair> Measure(const CameraModel& camera, const PoseCheck::AgreeingPair& pair);
  void Decide();
  std::optional<Best> FindBest() const;  // if it contradicts the given focal length

  CameraModel camera_;
  std::deque<Pair> pairs_;  // the newest ones
  bool has_older_pairs_ = false;
  std::optional<Best> best_;
  uint64_t contradicted_since_frame_ = 0;
};

}  // namespace romap::slam
