#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/geometry.h"

namespace romap::eval {

// An estimated and a true pose of the same frame. Each pose is in the world of its trajectory.
struct PosePair {
  int64_t timestamp_ns = 0;  // of the true pose
  SE3<World, Camera> estimated;
  SE3<World, Camera> truth;
};

// The motion from one pair to a later one. The translations are in the camera frame at the start. Therefore they need
// no alignment of the worlds, and no alignment can hide a translation in the wrong direction.
struct RelativeMotion {
  int64_t start_ns = 0;
  int64_t end_ns = 0;
  double path_m = 0;                                    // length of the true path up to the start
  Eigen::Vector3d estimated = Eigen::Vector3d::Zero();  // Camera frame, in the unit of the estimated trajectory
  Eigen::Vector3d truth = Eigen::Vector3d::Zero();      // Camera frame, m
  double rotation_error_deg = 0;
};

// The motions between consecutive pairs (sorted by time), also across gaps.
std::vector<RelativeMotion> FrameMotions(std::span<const PosePair> pairs);

// For each pair, the motion to the first pair at least `window_s` later; none if that pair is more than 1.5 windows
// later.
std::vector<RelativeMotion> WindowMotions(std::span<const PosePair> pairs, double window_s);

// Correlation of the directions of estimated and true translation: the mean cosine of the angle between them, weighted
// by the true length. 1 = same direction, 0 = unrelated, -1 = opposite. Independent of the scale, and one jump changes
// it no more than any other motion. nullopt without true translation.
std::optional<double> DirectionCorrelation(std::span<const RelativeMotion> motions);

// Median ratio of true to estimated length, negative if the direction of most translations is opposite. Ignores motions
// much shorter than usual. nullopt if fewer than three remain or their median estimated length is 0.
std::optional<double> SignedScale(std::span<const RelativeMotion> motions);

// SignedScale of each of `sections` parts of the true path with the same length; sections without a scale are omitted.
std::vector<double> LocalScales(std::span<const RelativeMotion> motions, int sections);

// The largest errors of a motion between consecutive frames.
struct Jumps {
  double position_m = 0;
  double position_s = 0;  // timestamp
  double rotation_deg = 0;
  double rotation_s = 0;  // timestamp
};

// `scale` converts estimated lengths to m.
Jumps LargestJumps(std::span<const RelativeMotion> frame_motions, double scale);

// Motion over about a second, or between frames if the trajectory is too short or its frames too rare.
struct MotionFigures {
  double window_s = 0;  // length of the windows; 0 = between consecutive frames
  // DirectionCorrelation; nullopt if the true camera hardly moves.
  std::optional<double> frame_correlation = std::nullopt;
  std::optional<double> window_correlation = std::nullopt;
  double rotation_median_deg = 0;  // error of the relative rotation over a window
  double rotation_95_deg = 0;
  // From estimated to true lengths, independent of any alignment; negative if the translation is reversed. nullopt if
  // the scale is not observable; then scale_note has the reason.
  std::optional<double> scale = std::nullopt;
  std::string scale_note = {};
  std::vector<double> local_scales = {};  // along the path; empty if the scale is not observable
  Jumps jumps = {};

  std::string WindowText() const;  // "over 1 s" or "between frames"
};

constexpr double kWindow_s = 1;  // long enough that the translation exceeds the noise of a handheld camera's pose
constexpr int kPathSections = 5;
// Root mean square distance of the true positions from their mean, below which translation is not observable: 2 cm are
// a parallax of about 5 px at 2 m (focal length 500 px), comparable with tracking and ground-truth errors.
constexpr double kMinExtent_m = 0.02;
// Below this correlation (absolute value), the errors exceed the true translation, and the ratio of lengths is noise.
constexpr double kMinScaleCorrelation = 0.3;

// `pairs` (at least two) are sorted by time; `extent_m` is the rms distance of the true positions from their mean;
// `fit_scale` converts estimated lengths to m for the jumps.
MotionFigures MeasureMotion(std::span<const PosePair> pairs, double extent_m, double fit_scale);

}  // namespace romap::eval
