#include "client/eval/boxes_eval.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "client/files/objects_yaml.h"
#include "common/angles.h"
#include "common/assignment.h"

namespace romap::eval {
namespace {

using Polygon = std::vector<Eigen::Vector2d>;

// Corners of the footprint in the xy plane, relative to `origin`, counter-clockwise.
Polygon Footprint(const YawBox& box, const Eigen::Vector2d& origin) {
  Polygon corners;
  const Eigen::Rotation2Dd yaw(box.yaw_rad);
  for (const auto& [x, y] : {std::pair{1, 1}, {-1, 1}, {-1, -1}, {1, -1}}) {
    corners.push_back(yaw * Eigen::Vector2d(x * box.half_extents.x(), y * box.half_extents.y()) +
                      (box.center.head<2>() - origin));
  }
  return corners;
}

// The part of a polygon to the left of the line a -> b (Sutherland and Hodgman, CACM 1974).
Polygon Clip(const Polygon& polygon, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const auto side = [&](const Eigen::Vector2d& p) { return (b - a).x() * (p - a).y() - (b - a).y() * (p - a).x(); };
  Polygon kept;
  for (size_t k = 0; k < polygon.size(); ++k) {
    const Eigen::Vector2d& p = polygon[k];
    const Eigen::Vector2d& q = polygon[(k + 1) % polygon.size()];
    const double side_p = side(p), side_q = side(q);
    if (side_p >= 0) kept.push_back(p);
    if ((side_p >= 0) != (side_q >= 0)) kept.push_back(p + (q - p) * (side_p / (side_p - side_q)));
  }
  return kept;
}

double Area(const Polygon& polygon) {
  double doubled = 0;
  for (size_t k = 0; k < polygon.size(); ++k) {
    const Eigen::Vector2d& p = polygon[k];
    const Eigen::Vector2d& q = polygon[(k + 1) % polygon.size()];
    doubled += p.x() * q.y() - p.y() * q.x();
  }
  return std::abs(doubled) / 2;
}

std::vector<YawBox> ToUpright(const files::ObjectsYaml& objects, const Eigen::Quaterniond& z_from_up,
                              const Sim3<World, World>& S_gt_est) {
  std::vector<YawBox> boxes;
  for (const files::ObjectRecord& object : objects.objects) {
    const SE3<World, Object> T_gt_object = S_gt_est.Moved(object.T_world_object);
    boxes.push_back(MakeUpright((z_from_up * T_gt_object.rotation()).toRotationMatrix(),
                                z_from_up * T_gt_object.translation(), S_gt_est.scale() * object.half_extents));
  }
  return boxes;
}

BoxFigures Compare(const YawBox& predicted, const YawBox& truth, double iou) {
  BoxFigures figures;
  figures.iou = iou;
  figures.center_cm = 100 * (predicted.center - truth.center).norm();
  const double difference_deg = (predicted.yaw_rad - truth.yaw_rad) * kDegPerRad;
  const double quarter_turns = std::floor((difference_deg + 45) / 90);
  figures.yaw_deg = std::abs(difference_deg - 90 * quarter_turns);
  figures.tilt_deg = predicted.tilt_deg;
  Eigen::Vector3d half_extents = predicted.half_extents;
  if (static_cast<int>(quarter_turns) % 2 != 0) std::swap(half_extents.x(), half_extents.y());
  Eigen::Vector3d::Map(figures.size_ratio.data()) = half_extents.cwiseQuotient(truth.half_extents);
  return figures;
}

void AddMeans(BoxesReport* report) {
  for (const BoxRow& row : report->rows) {
    if (!row.match) continue;
    ++report->matched;
    report->iou_matched += row.match->iou;
    report->center_cm += row.match->center_cm;
    report->yaw_deg += row.match->yaw_deg;
  }
  report->iou_all = report->iou_matched / static_cast<double>(report->rows.size());
  if (report->matched == 0) return;
  const double count = static_cast<double>(report->matched);
  report->iou_matched /= count;
  report->center_cm /= count;
  report->yaw_deg /= count;
}

// The transform from the world of the predicted cuboids to that of the true ones.
absl::StatusOr<Sim3<World, World>> WorldAlignment(const BoxesEvalOptions& options) {
  if (options.estimated_trajectory.empty() != options.true_trajectory.empty()) {
    return InvalidArgument("both or neither of the estimated and the true trajectory must be given");
  }
  if (options.estimated_trajectory.empty()) return Sim3<World, World>();
  ROMAP_ASSIGN_OR_RETURN(const std::vector<files::StampedPose> estimated, files::ReadTum(options.estimated_trajectory));
  ROMAP_ASSIGN_OR_RETURN(const std::vector<files::StampedPose> truth, files::ReadTum(options.true_trajectory));
  ROMAP_ASSIGN_OR_RETURN(const TrajectoryFit fit,
                         AlignTrajectories(estimated, truth, options.trajectory_alignment, options.max_dt_s));
  return fit.S_gt_est;
}

}  // namespace

YawBox MakeUpright(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& center,
                   const Eigen::Vector3d& half_extents) {
  Eigen::Index vertical = 0;
  rotation.row(2).cwiseAbs().maxCoeff(&vertical);
  const Eigen::Index x = (vertical + 1) % 3;
  const Eigen::Index y = (vertical + 2) % 3;
  YawBox box;
  box.center = center;
  box.yaw_rad = std::atan2(rotation(1, x), rotation(0, x));
  box.half_extents = {half_extents[x], half_extents[y], half_extents[vertical]};
  box.tilt_deg = std::acos(std::min(std::abs(rotation(2, vertical)), 1.0)) * kDegPerRad;
  return box;
}

double IntersectionOverUnion(const YawBox& a, const YawBox& b) {
  // The products of coordinates in Area() cancel, so the origin must be near.
  Polygon overlap = Footprint(a, a.center.head<2>());
  const Polygon edges = Footprint(b, a.center.head<2>());
  for (size_t k = 0; k < edges.size() && !overlap.empty(); ++k) {
    overlap = Clip(overlap, edges[k], edges[(k + 1) % edges.size()]);
  }
  const double top = std::min(a.center.z() + a.half_extents.z(), b.center.z() + b.half_extents.z());
  const double bottom = std::max(a.center.z() - a.half_extents.z(), b.center.z() - b.half_extents.z());
  const double intersection = Area(overlap) * std::max(top - bottom, 0.0);
  return intersection / (8 * a.half_extents.prod() + 8 * b.half_extents.prod() - intersection);
}

absl::StatusOr<BoxesReport> EvaluateBoxes(const BoxesEvalOptions& options) {
  ROMAP_ASSIGN_OR_RETURN(const files::ObjectsYaml predicted, files::ReadObjects(options.predicted));
  ROMAP_ASSIGN_OR_RETURN(const files::ObjectsYaml truth, files::ReadObjects(options.ground_truth));
  if (predicted.objects.empty()) return InvalidArgument("{}: the file contains no objects", options.predicted);
  if (truth.objects.empty()) return InvalidArgument("{}: the file contains no objects", options.ground_truth);
  ROMAP_ASSIGN_OR_RETURN(const auto S_gt_est, WorldAlignment(options));
  const Eigen::Quaterniond z_from_up = RotationFromZTo(truth.up_world).conjugate();
  const std::vector<YawBox> p = ToUpright(predicted, z_from_up, S_gt_est);
  const std::vector<YawBox> g = ToUpright(truth, z_from_up, {});

  Eigen::MatrixXd distance(g.size(), p.size()), iou(g.size(), p.size());
  for (size_t i = 0; i < g.size(); ++i) {
    for (size_t j = 0; j < p.size(); ++j) {
      distance(i, j) = (p[j].center - g[i].center).norm() / (2 * g[i].half_extents.norm());
      iou(i, j) = IntersectionOverUnion(p[j], g[i]);
    }
  }
  // Distances above ten diagonals cost the same.
  const std::vector<int> match = AssignRows(distance.cwiseMin(10) - iou);
  BoxesReport report;
  report.trajectory_scale = S_gt_est.scale();
  std::vector<bool> used(p.size());
  for (size_t i = 0; i < g.size(); ++i) {
    const int j = match[i];
    report.rows.push_back({truth.objects[i].name, std::nullopt});
    if (j < 0 || (distance(i, j) > options.match_distance && iou(i, j) <= 0)) continue;
    used[j] = true;
    report.rows.back().match = Compare(p[j], g[i], iou(i, j));
    report.rows.back().match->predicted = fmt::format("{}:{}", predicted.objects[j].id, predicted.objects[j].name);
  }
  for (size_t j = 0; j < p.size(); ++j) {
    if (!used[j]) report.extra.push_back(predicted.objects[j].name);
  }
  AddMeans(&report);
  if (report.matched == 0) {
    return InvalidArgument("{}: no cuboid is near a true object; if the world frames differ, give both trajectories",
                           options.predicted);
  }
  return report;
}

}  // namespace romap::eval
