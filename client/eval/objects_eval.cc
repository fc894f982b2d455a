#include "client/eval/objects_eval.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <random>

#include "client/eval/points.h"
#include "client/eval/seen_frames.h"
#include "client/files/mesh_file.h"
#include "client/files/tum.h"
#include "common/angles.h"
#include "common/assignment.h"
#include "common/mesh_components.h"
#include "common/statistics.h"

namespace romap::eval {
namespace {

constexpr double kCmPerM = 100;
constexpr double kMinBoxIou = 0.02;    // boxes with this overlap may be paired regardless of their distance
constexpr double kInferredSource = 2;  // `source` of points that were inferred, not measured

// A surface as points, each with its visibility.
struct Surface {
  std::string name;
  Points points;
  Points normals = {};         // as many as points, or none
  std::vector<bool> seen;      // whether some camera saw the point, same length as points; true surfaces only
  std::vector<bool> inferred;  // whether the point was not measured, same length as points; true surfaces only
  size_t faces = 0;
  size_t components = 0;
};

// Axis-aligned box of a surface without the outermost percent of points on each side, which may be outliers.
struct RobustBox {
  Eigen::Vector3d low, high;
  Eigen::Vector3d Center() const { return (low + high) / 2; }
  double Volume() const { return (high - low).prod(); }
};

// The predicted surface that is paired with a true one.
struct Pair {
  size_t predicted = 0;
  double center_distance_m = 0;
  double box_iou = 0;
};

absl::Status ValidateOptions(const ObjectsEvalOptions& options) {
  if (options.estimated_trajectory.empty() != options.true_trajectory.empty()) {
    return InvalidArgument("both or neither of the estimated and the true trajectory must be given");
  }
  if (options.samples < 100 || options.icp_points < 100) {
    return InvalidArgument("samples ({}) and icp_points ({}) must be at least 100", options.samples,
                           options.icp_points);
  }
  if (options.dataset_every < 1)
    return InvalidArgument("dataset_every is {}; expected a positive number", options.dataset_every);
  for (const double threshold_cm : options.thresholds_cm) {
    if (!(threshold_cm > 0)) return InvalidArgument("threshold is {} cm; expected a positive number", threshold_cm);
  }
  return absl::OkStatus();
}

// The points that were measured and not inferred, without their normals.
Surface WithoutInferred(const Surface& surface) {
  Surface kept{.name = surface.name, .points = {}, .seen = {}, .inferred = {}, .faces = surface.faces};
  for (size_t k = 0; k < surface.points.size(); ++k) {
    if (surface.inferred[k]) continue;
    kept.points.push_back(surface.points[k]);
    kept.seen.push_back(surface.seen[k]);
  }
  return kept;
}

absl::StatusOr<std::vector<Surface>> LoadSurfaces(const std::string& dir, const ObjectsEvalOptions& options,
                                                  uint32_t seed) {
  ROMAP_ASSIGN_OR_RETURN(const auto files, files::ReadMeshFolder(dir));
  std::vector<Surface> surfaces;
  for (const auto& [name, file] : files) {
    ROMAP_ASSIGN_OR_RETURN(OrientedPoints samples,
                           SampleOrientedSurface(file.mesh, options.samples, seed, dir + "/" + name));
    Surface surface{.name = name,
                    .points = std::move(samples.points),
                    .normals = std::move(samples.normals),
                    .seen = {},
                    .inferred = {},
                    .faces = file.mesh.triangles.size(),
                    .components = CountComponents(file.mesh)};
    for (Eigen::Vector3d& point : surface.points) point += file.origin;
    surface.seen.assign(surface.points.size(), true);
    surface.inferred.assign(surface.points.size(), false);
    const auto seen = file.scalars.find("seen");
    const auto source = file.scalars.find("source");
    if (surface.faces == 0 && seen != file.scalars.end()) {
      std::transform(seen->second.begin(), seen->second.end(), surface.seen.begin(), [](double s) { return s > 0; });
    }
    if (surface.faces == 0 && source != file.scalars.end()) {
      std::transform(source->second.begin(), source->second.end(), surface.inferred.begin(),
                     [](double s) { return s == kInferredSource; });
    }
    surfaces.push_back(std::move(surface));
  }
  return surfaces;
}

void Move(const Sim3<World, World>& similarity, Surface* surface) {
  surface->points = Transform(similarity, surface->points);
  for (Eigen::Vector3d& normal : surface->normals) normal = similarity.rotation() * normal;
}

// Transforms all predicted surfaces to the ground-truth world by aligning the trajectories. Returns the scale.
absl::StatusOr<double> AlignByTrajectories(const ObjectsEvalOptions& options, std::vector<Surface>* predicted) {
  if (options.estimated_trajectory.empty()) return 1.0;
  ROMAP_ASSIGN_OR_RETURN(const std::vector<files::StampedPose> estimated, files::ReadTum(options.estimated_trajectory));
  ROMAP_ASSIGN_OR_RETURN(const std::vector<files::StampedPose> truth, files::ReadTum(options.true_trajectory));
  ROMAP_ASSIGN_OR_RETURN(const TrajectoryFit fit,
                         AlignTrajectories(estimated, truth, options.trajectory_alignment, options.max_dt_s));
  for (Surface& surface : *predicted) Move(fit.S_gt_est, &surface);
  return fit.S_gt_est.scale();
}

RobustBox BoxOf(const Points& points) {
  RobustBox box;
  std::vector<double> values(points.size());
  for (int axis = 0; axis < 3; ++axis) {
    std::transform(points.begin(), points.end(), values.begin(), [&](const Eigen::Vector3d& p) { return p[axis]; });
    box.low[axis] = Quantile(values, 0.01);
    box.high[axis] = Quantile(values, 0.99);
  }
  return box;
}

double BoxIou(const RobustBox& a, const RobustBox& b) {
  const double intersection = (a.high.cwiseMin(b.high) - a.low.cwiseMax(b.low)).cwiseMax(0).prod();
  const double total = a.Volume() + b.Volume() - intersection;
  return total > 0 ? intersection / total : 0;
}

// Pairs true and predicted surfaces one to one by the overlap and the distance of their boxes.
std::vector<std::optional<Pair>> MatchSurfaces(const std::vector<Surface>& truth, const std::vector<Surface>& predicted,
                                               double match_distance) {
  std::vector<RobustBox> true_boxes, predicted_boxes;
  for (const Surface& surface : truth) true_boxes.push_back(BoxOf(surface.points));
  for (const Surface& surface : predicted) predicted_boxes.push_back(BoxOf(surface.points));
  Eigen::MatrixXd iou(truth.size(), predicted.size()), distance(truth.size(), predicted.size());
  for (size_t i = 0; i < truth.size(); ++i) {
    for (size_t j = 0; j < predicted.size(); ++j) {
      iou(i, j) = BoxIou(predicted_boxes[j], true_boxes[i]);
      distance(i, j) = (predicted_boxes[j].Center() - true_boxes[i].Center()).norm();
    }
  }
  Eigen::MatrixXd relative = distance;
  for (size_t i = 0; i < truth.size(); ++i) {
    relative.row(i) /= std::max((true_boxes[i].high - true_boxes[i].low).norm(), 1e-9);
  }
  // Distances above ten diagonals cost the same; overlap has twice the weight.
  const std::vector<int> match = AssignRows(relative.cwiseMin(10) - 2 * iou);
  std::vector<std::optional<Pair>> pairs(truth.size());
  for (size_t i = 0; i < truth.size(); ++i) {
    const int j = match[i];
    if (j < 0 || (iou(i, j) <= kMinBoxIou && relative(i, j) >= match_distance)) continue;
    pairs[i] = Pair{static_cast<size_t>(j), distance(i, j), iou(i, j)};
  }
  return pairs;
}

// A random subset of up to `count` points.
Points Subset(const Points& points, size_t count, std::mt19937_64* random) {
  Points subset;
  std::sample(points.begin(), points.end(), std::back_inserter(subset), count, *random);
  return subset;
}

// Aligns the predicted points with the true ones by ICP.
IcpFigures AlignByIcp(const ObjectsEvalOptions& options, const Surface& truth, std::mt19937_64* random,
                      Surface* predicted) {
  const Points source = Subset(predicted->points, options.icp_points, random);
  const auto fit = Icp(source, truth.points, {.with_scale = options.alignment == Alignment::kSim3});
  if (!fit) return {.failed = true};
  Move(fit->S_target_source, predicted);
  return {.failed = false,
          .scale = fit->S_target_source.scale(),
          .rotation_deg = Eigen::AngleAxisd(fit->S_target_source.rotation()).angle() * kDegPerRad,
          .rms_cm = kCmPerM * fit->rms,
          .iterations = fit->iterations};
}

// Mean of the selected values [cm]; nullopt if none is selected.
std::optional<double> MeanOf(const std::vector<double>& values_m, const std::vector<bool>& selected) {
  double sum = 0;
  size_t count = 0;
  for (size_t k = 0; k < values_m.size(); ++k) {
    if (!selected[k]) continue;
    sum += values_m[k];
    ++count;
  }
  return count == 0 ? std::nullopt : std::optional(kCmPerM * sum / static_cast<double>(count));
}

double Share(const std::vector<bool>& flags) {
  return static_cast<double>(std::count(flags.begin(), flags.end(), true)) / static_cast<double>(flags.size());
}

// Percentage of the selected values below the threshold; nullopt if none is selected.
std::optional<double> PercentBelow(const std::vector<double>& values_m, const std::vector<bool>& selected,
                                   double threshold_cm) {
  size_t below = 0, count = 0;
  for (size_t k = 0; k < values_m.size(); ++k) {
    if (!selected[k]) continue;
    ++count;
    if (kCmPerM * values_m[k] < threshold_cm) ++below;
  }
  if (count == 0) return std::nullopt;
  return 100 * static_cast<double>(below) / static_cast<double>(count);
}

// The points of `truth` that completion is measured on: all of them, or a random subset of `samples` points if there
// are more and the prediction is a mesh.
Surface CompletionPoints(const Surface& truth, size_t predicted_faces, size_t samples, std::mt19937_64* random) {
  if (truth.points.size() <= samples || predicted_faces == 0) return truth;
  Surface subset{.name = truth.name, .points = {}, .seen = {}, .inferred = {}, .faces = truth.faces};
  std::vector<size_t> indices(truth.points.size()), chosen;
  std::iota(indices.begin(), indices.end(), size_t{0});
  std::sample(indices.begin(), indices.end(), std::back_inserter(chosen), samples, *random);
  for (const size_t k : chosen) {
    subset.points.push_back(truth.points[k]);
    subset.seen.push_back(truth.seen[k]);
  }
  return subset;
}

// Measures the distances in both directions. `predicted` must be aligned. `frames` (may be null) marks further points
// of the object with the given mask label as seen.
void Measure(const Surface& truth, const Points& predicted, const SeenFrames* frames, int64_t label,
             const ObjectsEvalOptions& options, std::mt19937_64* random, ObjectMatch* match) {
  const Neighbors to_truth = NearestIndex(truth.points).Query(predicted);
  std::vector<bool> seen(predicted.size());
  for (size_t k = 0; k < seen.size(); ++k) seen[k] = truth.seen[to_truth.index[k]];
  if (frames != nullptr) {
    const std::vector<bool> in_frames = frames->Seen(predicted, label);
    for (size_t k = 0; k < seen.size(); ++k) seen[k] = seen[k] || in_frames[k];
  }
  const Surface target = CompletionPoints(truth, match->faces, options.samples, random);
  const Neighbors to_predicted = NearestIndex(predicted).Query(target.points);
  const std::vector<bool> all_predicted(predicted.size(), true), all_target(target.points.size(), true);
  SurfaceFigures& figures = match->figures;
  figures.accuracy_cm = *MeanOf(to_truth.distance, all_predicted);
  figures.accuracy_seen_cm = MeanOf(to_truth.distance, seen);
  figures.completion_cm = *MeanOf(to_predicted.distance, all_target);
  figures.completion_seen_cm = MeanOf(to_predicted.distance, target.seen);
  for (const double threshold_cm : options.thresholds_cm) {
    figures.ratios.push_back({threshold_cm, *PercentBelow(to_predicted.distance, all_target, threshold_cm),
                              PercentBelow(to_predicted.distance, target.seen, threshold_cm)});
  }
  match->predicted_seen_share = Share(seen);
  match->true_seen_share = Share(target.seen);
}

// Mean of an optional figure over the matched rows that have it.
template <class Get>
std::optional<double> MeanOverRows(const std::vector<ObjectRow>& rows, Get get) {
  double sum = 0;
  int count = 0;
  for (const ObjectRow& row : rows) {
    const std::optional<double> value = row.match ? get(row.match->figures) : std::nullopt;
    if (!value) continue;
    sum += *value;
    ++count;
  }
  return count == 0 ? std::nullopt : std::optional(sum / count);
}

void AddMeans(ObjectsReport* report) {
  using Value = std::optional<double>;
  const std::vector<ObjectRow>& rows = report->rows;
  ObjectsReport::Mean& mean = report->mean;
  mean.accuracy_cm = MeanOverRows(rows, [](const SurfaceFigures& f) { return Value(f.accuracy_cm); });
  mean.accuracy_seen_cm = MeanOverRows(rows, [](const SurfaceFigures& f) { return f.accuracy_seen_cm; });
  mean.completion_cm = MeanOverRows(rows, [](const SurfaceFigures& f) { return Value(f.completion_cm); });
  mean.completion_seen_cm = MeanOverRows(rows, [](const SurfaceFigures& f) { return f.completion_seen_cm; });
  mean.accuracy_closed_cm =
      MeanOverRows(rows, [](const SurfaceFigures& f) { return Value(f.shape.accuracy_closed_cm); });
  mean.hollow_percent = MeanOverRows(rows, [](const SurfaceFigures& f) { return f.shape.hollow_percent; });
  mean.normal_error_deg = MeanOverRows(rows, [](const SurfaceFigures& f) { return f.shape.normal_error_deg; });
  for (size_t k = 0; k < report->options.thresholds_cm.size(); ++k) {
    ObjectsReport::Mean::MeanRatio ratio;
    ratio.threshold_cm = report->options.thresholds_cm[k];
    ratio.all_percent = MeanOverRows(rows, [k](const SurfaceFigures& f) { return Value(f.ratios[k].all_percent); });
    ratio.seen_percent = MeanOverRows(rows, [k](const SurfaceFigures& f) { return f.ratios[k].seen_percent; });
    ratio.all_percent_with_missing =
        ratio.all_percent.value_or(0) * static_cast<double>(report->matched) / static_cast<double>(rows.size());
    mean.ratios.push_back(ratio);
  }
}

}  // namespace

absl::StatusOr<ObjectsReport> EvaluateObjects(const ObjectsEvalOptions& given) {
  ObjectsEvalOptions options = given;
  std::sort(options.thresholds_cm.begin(), options.thresholds_cm.end());
  ROMAP_RETURN_IF_ERROR(ValidateOptions(options));
  // Different seeds: with the same samples a mesh compared with itself would have zero error.
  ROMAP_ASSIGN_OR_RETURN(const std::vector<Surface> truth,
                         LoadSurfaces(options.ground_truth_dir, options, options.seed + 1));
  ROMAP_ASSIGN_OR_RETURN(std::vector<Surface> predicted, LoadSurfaces(options.predicted_dir, options, options.seed));
  std::vector<Surface> measured = truth;  // accuracy and completion are measured against these points
  if (options.ignore_inferred) {
    std::transform(truth.begin(), truth.end(), measured.begin(), WithoutInferred);
    for (const Surface& surface : measured) {
      if (!surface.points.empty()) continue;
      return InvalidArgument("{}/{}: all points are inferred", options.ground_truth_dir, surface.name);
    }
  }
  ObjectsReport report;
  report.options = options;
  ROMAP_ASSIGN_OR_RETURN(report.trajectory_scale, AlignByTrajectories(options, &predicted));
  std::optional<SeenFrames> frames;
  if (!options.dataset_dir.empty()) {
    ROMAP_ASSIGN_OR_RETURN(frames, SeenFrames::Load(options.dataset_dir, options.dataset_every));
  }
  const std::vector<std::optional<Pair>> pairs = MatchSurfaces(measured, predicted, options.match_distance);
  std::mt19937_64 random(options.seed);
  std::vector<bool> used(predicted.size());
  for (size_t i = 0; i < truth.size(); ++i) {
    report.rows.push_back({truth[i].name, std::nullopt});
    if (!pairs[i]) continue;
    const std::optional<int64_t> label = frames ? frames->LabelOf(truth[i].name) : 0;
    if (!label) return InvalidArgument("{}/objects.yaml: no object named {}", options.dataset_dir, truth[i].name);
    Surface& surface = predicted[pairs[i]->predicted];
    ObjectMatch match;
    match.predicted = surface.name;
    match.center_distance_cm = kCmPerM * pairs[i]->center_distance_m;
    match.box_iou = pairs[i]->box_iou;
    match.faces = surface.faces;
    match.components = surface.components;
    if (options.alignment != Alignment::kNone) match.icp = AlignByIcp(options, measured[i], &random, &surface);
    Measure(measured[i], surface.points, frames ? &*frames : nullptr, *label, options, &random, &match);
    match.figures.shape = MeasureShape({truth[i].points, truth[i].normals}, {surface.points, surface.normals});
    report.rows.back().match = std::move(match);
    used[pairs[i]->predicted] = true;
    ++report.matched;
  }
  for (size_t j = 0; j < predicted.size(); ++j) {
    if (!used[j]) report.extra.push_back(predicted[j].name);
  }
  if (report.matched == 0) {
    return InvalidArgument("{}: no mesh overlaps a true object; if the world frames differ, give both trajectories",
                           options.predicted_dir);
  }
  AddMeans(&report);
  return report;
}

}  // namespace romap::eval
