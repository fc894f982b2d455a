#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "client/eval/alignment.h"
#include "common/status.h"

namespace romap::eval {

struct BoxesEvalOptions {
  std::string predicted;     // cuboids, .json or .yaml
  std::string ground_truth;  // objects.yaml of the sequence
  // Give both or neither. If given, the cuboids are first transformed by the alignment of the two trajectories.
  std::string estimated_trajectory;
  std::string true_trajectory;
  Alignment trajectory_alignment = Alignment::kSim3;
  double max_dt_s = 0.02;
  double match_distance = 0.75;  // maximal center distance of a pair without overlap, in diagonals of the true box
};

struct BoxFigures {
  std::string predicted;  // "id:name"
  double iou = 0;         // intersection over union of the volumes, with both boxes made upright
  double center_cm = 0;
  double yaw_deg = 0;                  // modulo 90 degrees, 0..45, because a cuboid has no front
  double tilt_deg = 0;                 // of the vertical axis of the predicted box
  std::array<double, 3> size_ratio{};  // predicted to true, along the axes of the true box
};

struct BoxRow {
  std::string object;
  std::optional<BoxFigures> match;  // absent if no predicted box is near
};

struct BoxesReport {
  std::vector<BoxRow> rows;  // one per true object
  size_t matched = 0;
  double iou_matched = 0;  // mean over matched objects
  double iou_all = 0;      // mean over all true objects; missing objects count as 0
  double center_cm = 0;
  double yaw_deg = 0;
  std::vector<std::string> extra;  // predicted boxes without a true object
  double trajectory_scale = 1;
};

// Pairs cuboids one to one with the true cuboids and measures 3D IoU, center and yaw errors. INVALID_ARGUMENT: no
// boxes, or no box near a true one (e.g. different world frames). Otherwise as ReadObjects and ReadTum.
absl::StatusOr<BoxesReport> EvaluateBoxes(const BoxesEvalOptions& options);

// An upright box: its vertical axis is z.
struct YawBox {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double yaw_rad = 0;
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();
  double tilt_deg = 0;  // tilt that was removed to make the box upright
};

// Makes a box upright: the axis closest to z becomes the vertical axis.
YawBox MakeUpright(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& center, const Eigen::Vector3d& half_extents);

// Intersection over union of the volumes, 0..1.
double IntersectionOverUnion(const YawBox& a, const YawBox& b);

}  // namespace romap::eval
