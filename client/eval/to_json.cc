#include <nlohmann/json.hpp>

#include "client/eval/eval.h"

namespace romap::eval {
namespace {

using Json = nlohmann::ordered_json;

Json OrNull(std::optional<double> value) { return value ? Json(*value) : Json(nullptr); }

Json VerdictToJson(const Verdict& verdict) {
  return {{"level", ToString(verdict.level)}, {"reasons", verdict.reasons}};
}

// The figures that a row and the mean have in common.
template <class Figures>
void AddSurface(const Figures& figures, Json* json) {
  (*json)["acc_cm"] = OrNull(figures.accuracy_cm);
  (*json)["acc_seen_cm"] = OrNull(figures.accuracy_seen_cm);
  (*json)["comp_cm"] = OrNull(figures.completion_cm);
  (*json)["comp_seen_cm"] = OrNull(figures.completion_seen_cm);
  for (const auto& ratio : figures.ratios) {
    (*json)[fmt::format("ratio_{}", ratio.threshold_cm)] = OrNull(ratio.all_percent);
    (*json)[fmt::format("ratio_seen_{}", ratio.threshold_cm)] = OrNull(ratio.seen_percent);
  }
}

template <class Shape>
void AddShape(const Shape& shape, Json* json) {
  (*json)["acc_closed_cm"] = OrNull(shape.accuracy_closed_cm);
  (*json)["hollow_percent"] = OrNull(shape.hollow_percent);
  (*json)["normal_error_deg"] = OrNull(shape.normal_error_deg);
}

Json RowToJson(const ObjectRow& row) {
  Json json = {{"object", row.object}};
  if (!row.match) {
    json["predicted"] = nullptr;
    return json;
  }
  const ObjectMatch& match = *row.match;
  json["predicted"] = match.predicted;
  json["centroid_cm_before"] = match.center_distance_cm;
  json["box_iou_before"] = match.box_iou;
  json["faces"] = match.faces;
  json["components"] = match.components;
  if (match.icp) {
    json["icp_failed"] = match.icp->failed;
    json["icp_scale"] = match.icp->scale;
    json["icp_rms_cm"] = match.icp->failed ? Json(nullptr) : Json(match.icp->rms_cm);
    json["icp_iterations"] = match.icp->iterations;
    json["icp_rotation_deg"] = match.icp->rotation_deg;
  }
  json["acc_seen_share"] = match.predicted_seen_share;
  json["gt_seen_share"] = match.true_seen_share;
  AddSurface(match.figures, &json);
  AddShape(match.figures.shape, &json);
  return json;
}

}  // namespace

Json ToJson(const ObjectsReport& report) {
  Json json;
  json["objects"] = Json::array();
  for (const ObjectRow& row : report.rows) json["objects"].push_back(RowToJson(row));
  json["mean"] = Json::object();
  AddSurface(report.mean, &json["mean"]);
  AddShape(report.mean, &json["mean"]);
  json["matched"] = report.matched;
  json["gt_objects"] = report.rows.size();
  json["extra"] = report.extra;
  json["traj_scale"] = report.trajectory_scale;
  const ObjectsEvalOptions& options = report.options;
  json["settings"] = {{"align", ToString(options.alignment)},
                      {"samples", options.samples},
                      {"seed", options.seed},
                      {"thresholds_cm", options.thresholds_cm},
                      {"ignore_inferred", options.ignore_inferred},
                      {"seen_by_masks", !options.dataset_dir.empty()}};
  return json;
}

Json ToJson(const BoxesReport& report) {
  Json json;
  json["objects"] = Json::array();
  for (const BoxRow& row : report.rows) {
    Json entry = {{"object", row.object}, {"predicted", nullptr}, {"iou", 0.0}};
    if (row.match) {
      entry["predicted"] = row.match->predicted;
      entry["iou"] = row.match->iou;
      entry["center_cm"] = row.match->center_cm;
      entry["yaw_deg"] = row.match->yaw_deg;
      entry["tilt_deg"] = row.match->tilt_deg;
      entry["size_ratio"] = row.match->size_ratio;
    }
    json["objects"].push_back(std::move(entry));
  }
  json["mean"] = {{"iou_all_gt", report.iou_all},
                  {"iou_matched", report.iou_matched},
                  {"center_cm", report.center_cm},
                  {"yaw_deg", report.yaw_deg}};
  json["extra"] = report.extra;
  json["traj_scale"] = report.trajectory_scale;
  return json;
}

Json ToJson(const TrajectoryReport& report) {
  const MotionFigures& motion = report.motion;
  const FrameCoverage& coverage = report.coverage;
  Json json = {{"align", ToString(report.alignment)},
               {"est_poses", report.estimated_poses},
               {"gt_poses", report.ground_truth_poses},
               {"matched", report.matched},
               {"scale", report.scale},
               {"gt_path_length_m", report.path_length_m},
               {"gt_extent_m", report.extent_m},
               {"ate_rmse_m", report.ate_rmse_m},
               {"ate_mean_m", report.ate_mean_m},
               {"ate_median_m", report.ate_median_m},
               {"ate_max_m", report.ate_max_m},
               {"rot_rmse_deg", report.rotation_rmse_deg},
               {"rot_max_deg", report.rotation_max_deg}};
  json["motion"] = {{"window_s", motion.window_s},
                    {"frame_correlation", OrNull(motion.frame_correlation)},
                    {"window_correlation", OrNull(motion.window_correlation)},
                    {"rot_median_deg", motion.rotation_median_deg},
                    {"rot_95_deg", motion.rotation_95_deg},
                    {"scale", OrNull(motion.scale)},
                    {"scale_note", motion.scale_note},
                    {"local_scales", motion.local_scales},
                    {"max_jump_m", motion.jumps.position_m},
                    {"max_jump_m_at_s", motion.jumps.position_s},
                    {"max_jump_deg", motion.jumps.rotation_deg},
                    {"max_jump_deg_at_s", motion.jumps.rotation_s}};
  json["frames"] = {{"all", coverage.frames},
                    {"tracked", coverage.tracked},
                    {"before_first", coverage.before_first},
                    {"lost", coverage.lost},
                    {"inferred", coverage.inferred}};
  json["calibration"] = nullptr;
  if (report.calibration) {
    json["calibration"] = {{"position_95", report.calibration->position_coverage},
                           {"rotation_95", report.calibration->rotation_coverage},
                           {"position_bound_ratio", report.calibration->position_bound_ratio},
                           {"rotation_bound_ratio", report.calibration->rotation_bound_ratio},
                           {"poses", report.calibration->poses}};
  }
  json["verdict"] = VerdictToJson(report.verdict);
  return json;
}

Json ToJson(const RunReport& report) {
  Json json;
  json["alignment"] = {{"align", ToString(report.alignment.alignment)}, {"reason", report.alignment.reason}};
  json["objects"] = report.objects ? ToJson(*report.objects) : Json(nullptr);
  json["boxes"] = report.boxes ? ToJson(*report.boxes) : Json(nullptr);
  json["trajectory"] = report.trajectory ? ToJson(*report.trajectory) : Json(nullptr);
  json["verdict"] = report.verdict ? VerdictToJson(*report.verdict) : Json(nullptr);
  json["notes"] = report.notes;
  return json;
}

}  // namespace romap::eval
