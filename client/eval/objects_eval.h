#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/eval/alignment.h"
#include "client/eval/shape_eval.h"
#include "common/status.h"

namespace romap::eval {

struct ObjectsEvalOptions {
  std::string predicted_dir;  // meshes (.ply, .obj) with any names
  // True surfaces. Point clouds may have normals, and the vertex properties `seen` (0 or 1) and `source` (2 =
  // inferred, not measured).
  std::string ground_truth_dir;
  Alignment alignment = Alignment::kSim3;  // per-object ICP
  std::vector<double> thresholds_cm{0.4, 1.0};
  // Give both or neither. If given, the meshes are first transformed by the alignment of the two trajectories.
  std::string estimated_trajectory;
  std::string true_trajectory;
  Alignment trajectory_alignment = Alignment::kSim3;
  double max_dt_s = 0.02;
  // A sequence with masks (labels are the ids of its objects.yaml), depth and poses. If given, a predicted point also
  // counts as seen if in some frame it is in the mask of its object and at most 2 cm behind the true depth.
  std::string dataset_dir;
  int dataset_every = 4;  // use every n-th frame with a mask
  size_t samples = 100'000;
  uint32_t seed = 0;
  double match_distance = 0.5;  // maximal center distance of a pair without overlap, in diagonals of the true box
  size_t icp_points = 20'000;
  bool ignore_inferred = false;  // ignore true points with source = 2; ShapeFigures always consider them
};

struct Ratio {
  double threshold_cm = 0;
  double all_percent = 0;
  std::optional<double> seen_percent;
};

// Distances between sampled surfaces, and the share of the true surface that was reconstructed. The "seen" figures
// consider only the part that the cameras saw; nullopt if there is none.
struct SurfaceFigures {
  double accuracy_cm = 0;  // mean distance from predicted points to the nearest true one
  std::optional<double> accuracy_seen_cm;
  double completion_cm = 0;  // mean distance from true points to the nearest predicted one
  std::optional<double> completion_seen_cm;
  std::vector<Ratio> ratios;  // completion ratio: percentage of true points closer than a threshold
  ShapeFigures shape;
};

struct IcpFigures {
  bool failed = false;  // the scale diverged; the object is measured without ICP
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
  size_t components = 0;
  double predicted_seen_share = 0;  // share of the predicted points that were seen
  double true_seen_share = 0;       // share of the true points that were seen
  std::optional<IcpFigures> icp;
  SurfaceFigures figures;
};

struct ObjectRow {
  std::string object;
  std::optional<ObjectMatch> match;  // absent if no predicted mesh overlaps
};

struct ObjectsReport {
  std::vector<ObjectRow> rows;  // one per true object
  size_t matched = 0;
  // Means over the matched objects that have the figure.
  struct Mean {
    std::optional<double> accuracy_cm, accuracy_seen_cm, completion_cm, completion_seen_cm;
    std::optional<double> accuracy_closed_cm, hollow_percent, normal_error_deg;  // see ShapeFigures
    struct MeanRatio {
      double threshold_cm = 0;
      std::optional<double> all_percent, seen_percent;
      double all_percent_with_missing = 0;  // missing objects count as 0
    };
    std::vector<MeanRatio> ratios;
  } mean;
  std::vector<std::string> extra;  // predicted meshes without a true object
  double trajectory_scale = 1;
  ObjectsEvalOptions options;  // as used
};

// Pairs object meshes one to one with true surfaces and measures accuracy, completion and completion ratio. Lengths are
// meters in the files and centimeters in the report. Sampling sets a noise floor: two samplings of the same surface of
// area A are about 0.5 sqrt(A / samples) apart. INVALID_ARGUMENT: options out of range, or no predicted mesh near a
// true object (e.g. different world frames). Otherwise as ReadMeshFolder, ReadTum and Sequence::Open.
absl::StatusOr<ObjectsReport> EvaluateObjects(const ObjectsEvalOptions& options);

}  // namespace romap::eval
