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
  // Both or neither: the cuboids are first moved by the alignment of the two trajectories.
  std::string estimated_trajectory;
  std::string true_trajectory;
  Alignment trajectory_alignment = Alignment::kSim3;
  double max_dt_s = 0.02;
  double match_distance = 0.75;  // largest centre distance of a pair without overlap, in true box diagonals
};

struct BoxFigures {
  std::string predicted;  // "id:name"
  double iou = 0;         // volume of the intersection over that of the union, both boxes taken as upright
  double center_cm = 0;
  double yaw_deg = 0;                  // modulo 90 degrees, 0..45: a cuboid has no front
  double tilt_deg = 0;                 // of the predicted box's vertical axis
  std::array<double, 3> size_ratio{};  // predicted to true, along the true box's axes
};

struct BoxRow {
  std::string object;
  std::optional<BoxFigures> match;  // none: no predicted box is near
};

struct BoxesReport {
  std::vector<BoxRow> rows;  // one per true object
  size_t matched = 0;
  double iou_matched = 0;  // mean over matched objects
  double iou_all = 0;      // mean over all true objects, missing ones count 0
  double center_cm = 0;
  double yaw_deg = 0;
  std::vector<std::string> extra;  // predicted without a true object
  double trajectory_scale = 1;
};

// 3D IoU, centre and yaw errors of cuboids paired one to one with the true ones. NOT_FOUND / INVALID_ARGUMENT: a file
// is missing or malformed, there are no boxes, or none is near any true one (another world frame?).
absl::StatusOr<BoxesReport> EvaluateBoxes(const BoxesEvalOptions& options);

// A box whose vertical axis is z.
struct YawBox {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double yaw_rad = 0;
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();
  double tilt_deg = 0;  // that was ignored to make it upright
};

// The axis of the box closest to z becomes its vertical one.
YawBox MakeUpright(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& center, const Eigen::Vector3d& half_extents);

double IntersectionOverUnion(const YawBox& a, const YawBox& b);

}  // namespace romap::eval
