#include "tests/bench/object_score.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/eval/boxes_eval.h"
#include "common/assignment.h"

namespace romap::measure {
namespace {

ObjectErrors Compare(const eval::YawBox& box, const eval::YawBox& truth) {
  const Eigen::Vector3d shift_cm = 100 * (box.center - truth.center);
  ObjectErrors errors;
  errors.iou = eval::IntersectionOverUnion(box, truth);
  errors.center_cm = shift_cm.norm();
  errors.in_plane_cm = shift_cm.head<2>().norm();
  errors.yaw_deg = std::abs(std::remainder((box.yaw_rad - truth.yaw_rad) * 180 / std::numbers::pi, 90.0));
  return errors;
}

// Index of the true object that each box is matched with, -1 = none.
std::vector<int> Match(const std::vector<eval::YawBox>& boxes, const std::vector<eval::YawBox>& truth) {
  constexpr double kInadmissible = 1e6;  // more than the sum of the costs of all admissible pairs
  Eigen::MatrixXd cost(boxes.size(), truth.size());
  for (size_t i = 0; i < boxes.size(); ++i) {
    for (size_t j = 0; j < truth.size(); ++j) {
      const double distance = (boxes[i].center - truth[j].center).norm() / truth[j].half_extents.norm();
      const bool admissible = distance <= 1 && eval::IntersectionOverUnion(boxes[i], truth[j]) > 0;
      cost(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = admissible ? distance : kInadmissible;
    }
  }
  std::vector<int> match = AssignRows(cost);
  for (size_t i = 0; i < match.size(); ++i) {
    if (match[i] >= 0 && cost(static_cast<Eigen::Index>(i), match[i]) >= kInadmissible) match[i] = -1;
  }
  return match;
}

// Name of the found object that the box shares the most volume with; empty if it overlaps none.
std::string MostOverlapped(const eval::YawBox& box, const std::vector<eval::YawBox>& truth,
                           const std::vector<TrueObject>& objects) {
  double most = 0;
  std::string name;
  for (size_t j = 0; j < truth.size(); ++j) {
    const double iou = eval::IntersectionOverUnion(box, truth[j]);
    if (!objects[j].found || iou <= most) continue;
    most = iou;
    name = objects[j].name;
  }
  return name;
}

}  // namespace

size_t MapScore::Found() const {
  return static_cast<size_t>(
      std::count_if(objects.begin(), objects.end(), [](const TrueObject& object) { return object.found; }));
}

size_t MapScore::Extra() const { return mapped.size() - Found(); }

MapScore ScoreMap(const files::ObjectsYaml& truth, std::span<const ObjectUpdate> objects,
                  const Sim3<World, World>& S_true_map) {
  const Eigen::Quaterniond z_from_up = RotationFromZTo(truth.up_world).conjugate();
  std::vector<eval::YawBox> true_boxes, boxes;
  MapScore score;
  for (const files::ObjectRecord& record : truth.objects) {
    true_boxes.push_back(eval::MakeUpright((z_from_up * record.T_world_object.rotation()).toRotationMatrix(),
                                           z_from_up * record.T_world_object.translation(), record.half_extents));
    score.objects.push_back({.name = record.name, .errors = {}});
  }
  for (const ObjectUpdate& object : objects) {
    const SE3<World, Object>& T = object.cuboid.T_world_object;
    const Eigen::Vector3d center_m = S_true_map * T.translation();
    boxes.push_back(eval::MakeUpright((z_from_up * S_true_map.rotation()) * T.RotationMatrix(), z_from_up * center_m,
                                      S_true_map.scale() * object.cuboid.half_extents));
    score.mapped.push_back({object, center_m, "", ""});
  }
  if (boxes.empty() || true_boxes.empty()) return score;
  const std::vector<int> match = Match(boxes, true_boxes);
  for (size_t i = 0; i < boxes.size(); ++i) {
    if (match[i] < 0) continue;
    const auto j = static_cast<size_t>(match[i]);
    score.mapped[i].matched = score.objects[j].name;
    score.objects[j].found = true;
    score.objects[j].errors = Compare(boxes[i], true_boxes[j]);
    score.objects[j].errors.right_class = objects[i].class_name == truth.objects[j].class_name;
  }
  for (size_t i = 0; i < boxes.size(); ++i) {
    if (match[i] < 0) score.mapped[i].overlaps = MostOverlapped(boxes[i], true_boxes, score.objects);
  }
  return score;
}

}  // namespace romap::measure
