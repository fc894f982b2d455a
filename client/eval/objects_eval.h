#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/eval/alignment.h"
#include "common/status.h"

namespace romap::eval {

// Which correspondences per-object ICP uses: those of the predicted points (as CloudCompare does), or also those of the
// true points that were seen.
enum class IcpKind { kOneSided, kSymmetric };

struct ObjectsEvalOptions {
  std::string predicted_dir;  // meshes (.ply, .obj), any names
  std::string
      ground_truth_dir;  // true surfaces; clouds may say per vertex `seen` (0, 1) and `source` (2 = inferred cap)
  Alignment alignment = Alignment::kSim3;  // per-object ICP
  std::vector<double> thresholds_cm{0.4, 1.0};
  // Both or neither: the meshes are first moved by the alignment of the two trajectories.
  std::string estimated_trajectory;
  std::string true_trajectory;
  Alignment trajectory_alignment = Alignment::kSim3;
  double max_dt_s = 0.02;
  // Sequence with masks (labels are ids of its objects.yaml), depth and poses: a predicted point also counts as seen
  // when it lies in its object's mask and at most 2 cm behind the true depth in some frame. Empty: not used.
  std::string dataset_dir;
  int dataset_every = 4;  // use every n-th masked frame of it
  size_t samples = 100'000;
  uint32_t seed = 0;
  double match_distance = 0.5;  // largest centre distance of a pair without overlap, in true diagonals
  IcpKind icp = IcpKind::kOneSided;
  double icp_overlap = 1;  // share of the closest predicted points that count in ICP, 0.1..1
  size_t icp_points = 20'000;
  bool no_cap = false;  // leave out true points with source = 2
};

struct Ratio {
  double threshold_cm = 0;
  double all_percent = 0;
  std::optional<double> seen_percent;
};

// Distances between surfaces sampled as points, and what share of the truth was found. "Seen" columns take only the
// part of the surface that the cameras saw; nullopt where nothing was seen.
struct SurfaceFigures {
  double accuracy_cm = 0;  // mean distance from predicted points to the nearest true one
  std::optional<double> accuracy_seen_cm;
  double completion_cm = 0;  // mean distance from true points to the nearest predicted one
  std::optional<double> completion_seen_cm;
  std::vector<Ratio> ratios;  // share of the true points nearer than a threshold
};

struct IcpFigures {
  bool failed = false;  // the scale ran away; measured without ICP
  double scale = 1;
  double rotation_deg = 0;
  double rms_cm = 0;
  int iterations = 0;
};

struct ObjectMatch {
  std::string predicted;
  double center_distance_cm = 0;  // of the boxes, before ICP
  double box_iou = 0;             // of the axis-aligned boxes, before ICP
  size_t faces = 0;
  double predicted_seen_share = 0;  // of the predicted points
  double true_seen_share = 0;       // of the true points
  std::optional<IcpFigures> icp;
  SurfaceFigures figures;
};

struct ObjectRow {
  std::string object;
  std::optional<ObjectMatch> match;  // none: no predicted mesh overlaps
};

struct ObjectsReport {
  std::vector<ObjectRow> rows;  // one per true object
  size_t matched = 0;
  // Means over matched objects, each figure over those that have it.
  struct Mean {
    std::optional<double> accuracy_cm, accuracy_seen_cm, completion_cm, completion_seen_cm;
    struct MeanRatio {
      double threshold_cm = 0;
      std::optional<double> all_percent, seen_percent;
      double all_percent_with_missing = 0;  // missing objects count 0
    };
    std::vector<MeanRatio> ratios;
  } mean;
  std::vector<std::string> extra;  // predicted without a true object
  double trajectory_scale = 1;
  ObjectsEvalOptions options;  // that gave these figures
};

// Accuracy, Completion and Completion Ratio of object meshes against true surfaces, paired one to one by overlap.
// Lengths are metres in the files and centimetres in the report. Two samplings of the same surface of area A are about
// 0.5 sqrt(A / samples) apart, not 0. NOT_FOUND / INVALID_ARGUMENT: files missing or malformed, options out of range,
// or no predicted mesh is near any true object (another world frame?).
absl::StatusOr<ObjectsReport> EvaluateObjects(const ObjectsEvalOptions& options);

}  // namespace romap::eval
