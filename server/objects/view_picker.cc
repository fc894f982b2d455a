#include "server/objects/view_picker.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "common/map_motion.h"
#include "common/statistics.h"
#include "server/objects/angles.h"
#include "server/objects/projection.h"

namespace romap::objects {
namespace {

constexpr double kMinSharpnessShare = 0.6;   // of the object's median sharpness; a view below it waits for a better one
constexpr size_t kMaxWaitingKeyframes = 24;  // kept until the object has a cuboid

// Why the candidate's mask does not fit what is known of the object, or nullptr. A body point must lie in the mask
// unless something hides it, and the mask must not reach far beyond the cuboid.
const char* FindDoubt(const ViewCandidate& candidate, const ViewContext& context) {
  const CameraModel& camera = candidate.frame->camera;
  const SE3<Camera, World> T_camera_world = candidate.T_world_camera.Inverse();
  int in_image = 0;
  int inside = 0;
  int outside = 0;
  for (const Eigen::Vector3d& p_world : context.body_world) {
    const auto pixel = ProjectToPixel(T_camera_world * p_world, camera);
    if (!pixel) continue;
    ++in_image;
    const uint16_t label = candidate.frame->labels.at<uint16_t>(pixel->y, pixel->x);
    inside += label == candidate.label ? 1 : 0;
    outside += label == 0 ? 1 : 0;
  }
  if (in_image < 0.6 * static_cast<double>(context.body_world.size())) return "too little of it is in the image";
  if (inside < 3 * outside) return "the mask misses much of its body";
  if (inside < 0.4 * in_image) return "it is mostly hidden";
  const cv::Rect expected = ProjectCuboid(context.cuboid, 1.3, camera, candidate.T_world_camera);
  const double covered = (expected & candidate.box_px).area();
  if (covered < 0.75 * candidate.box_px.area()) return "the mask reaches beyond its cuboid";
  return nullptr;
}

// The cuboid enlarged by half and the mask's box with a margin.
cv::Rect CropFor(const ViewCandidate& candidate, const Cuboid& cuboid) {
  const CameraModel& camera = candidate.frame->camera;
  const int margin_px = 8 + std::max(candidate.box_px.width, candidate.box_px.height) / 10;
  const cv::Point margin(margin_px, margin_px);
  const cv::Rect around_mask(candidate.box_px.tl() - margin, candidate.box_px.br() + margin);
  const cv::Rect around_cuboid = ProjectCuboid(cuboid, 1.5, camera, candidate.T_world_camera);
  return (around_mask | around_cuboid) & cv::Rect(0, 0, camera.width_px, camera.height_px);
}

// Where the detector missed a neighbour that stands before the object, its pixels are not background.
void HideBehindMissedNeighbours(const ViewCandidate& candidate, const ViewContext& context, cv::Mat* hidden) {
  const SE3<Camera, World> T_camera_world = candidate.T_world_camera.Inverse();
  const double own_depth = (T_camera_world * context.cuboid.T_world_object.translation()).z();
  for (const ViewContext::Neighbour& neighbour : context.neighbours) {
    const auto& detected = candidate.detected;
    if (std::find(detected.begin(), detected.end(), neighbour.key) != detected.end()) continue;
    if ((T_camera_world * neighbour.cuboid.T_world_object.translation()).z() >= own_depth) continue;
    if (ProjectCuboid(neighbour.cuboid, 1, candidate.frame->camera, candidate.T_world_camera).empty()) continue;
    std::vector<cv::Point> corners;
    for (const Eigen::Vector3d& corner : CuboidCorners(neighbour.cuboid, 1)) {
      const Eigen::Vector2d pixel = candidate.frame->camera.Project(T_camera_world * corner);
      corners.emplace_back(static_cast<int>(std::lround(pixel.x())), static_cast<int>(std::lround(pixel.y())));
    }
    std::vector<cv::Point> outline;
    cv::convexHull(corners, outline);
    cv::fillConvexPoly(*hidden, outline, cv::Scalar(1));
  }
}

// Labels of things that stand entirely behind the object: a ray that ends there meets nothing of the object.
std::vector<uint16_t> LabelsBehind(const ViewCandidate& candidate, const ViewContext& context) {
  const SE3<Camera, World> T_camera_world = candidate.T_world_camera.Inverse();
  const double far_depth = DepthRange(context.cuboid, T_camera_world).second;
  std::vector<uint16_t> labels;
  for (size_t i = 0; i < candidate.detected.size(); ++i) {
    const auto neighbour = std::find_if(context.neighbours.begin(), context.neighbours.end(),
                                        [&](const auto& n) { return n.key == candidate.detected[i]; });
    if (neighbour == context.neighbours.end()) continue;
    if (DepthRange(neighbour->cuboid, T_camera_world).first > far_depth) labels.push_back(candidate.detected_labels[i]);
  }
  return labels;
}

cv::Mat ClassifyRays(const ViewCandidate& candidate, const ViewContext& context, const cv::Rect& roi) {
  cv::Mat hidden = cv::Mat::zeros(candidate.frame->labels.size(), CV_8UC1);
  HideBehindMissedNeighbours(candidate, context, &hidden);
  std::vector<RayKind> kind_of_label(1 << 16, RayKind::kOccluder);
  kind_of_label[0] = RayKind::kBackground;
  for (uint16_t label : LabelsBehind(candidate, context)) kind_of_label[label] = RayKind::kBackground;
  kind_of_label[candidate.label] = RayKind::kObject;
  cv::Mat kinds(roi.size(), CV_8UC1);
  for (int v = 0; v < roi.height; ++v) {
    const auto* labels = candidate.frame->labels.ptr<uint16_t>(roi.y + v) + roi.x;
    const auto* hidden_row = hidden.ptr<uint8_t>(roi.y + v) + roi.x;
    auto* kind = kinds.ptr<uint8_t>(v);
    for (int u = 0; u < roi.width; ++u) {
      const bool unsure = labels[u] == 0 && hidden_row[u] != 0;
      kind[u] = static_cast<uint8_t>(unsure ? RayKind::kOccluder : kind_of_label[labels[u]]);
    }
  }
  return kinds;
}

ObjectView MakeView(const ViewCandidate& candidate, const ViewContext& context) {
  ObjectView view;
  view.object = context.object;
  view.keyframe = candidate.keyframe;
  view.camera = candidate.frame->camera;
  view.T_world_camera = candidate.T_world_camera;
  view.roi_px = CropFor(candidate, context.cuboid);
  // Copies, because a part of an image would keep all of it in memory.
  view.color_bgr = candidate.frame->image_bgr(view.roi_px).clone();
  view.ray_kind = ClassifyRays(candidate, context, view.roi_px);
  if (!candidate.frame->depth_mu.empty()) view.depth_mu = candidate.frame->depth_mu(view.roi_px).clone();
  const SE3<Camera, World> T_camera_world = candidate.T_world_camera.Inverse();
  for (size_t i = 0; i < candidate.points.size(); ++i) {
    const auto& members = context.object_points;
    if (!std::binary_search(members.begin(), members.end(), candidate.points[i])) continue;
    const Eigen::Vector3d* p_world = context.registry->Find(candidate.points[i]);
    if (p_world == nullptr) continue;
    const double z_mu = (T_camera_world * *p_world).z();
    if (!(z_mu > 0)) continue;
    view.sparse_depth.emplace_back(candidate.pixels_px[i].x(), candidate.pixels_px[i].y(), static_cast<float>(z_mu));
  }
  return view;
}

}  // namespace

double MeasureSharpness(const cv::Mat& image_bgr, const cv::Rect& box_px) {
  const cv::Rect box = box_px & cv::Rect({}, image_bgr.size());
  if (box.empty()) return 0;
  cv::Mat grey;
  cv::cvtColor(image_bgr(box), grey, cv::COLOR_BGR2GRAY);
  cv::Mat laplacian;
  cv::Laplacian(grey, laplacian, CV_16S);
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(laplacian, mean, deviation);
  return deviation[0] * deviation[0];
}

void ViewPicker::Offer(ViewCandidate candidate) {
  if (waiting_.size() >= kMaxWaitingKeyframes) {
    std::vector<ViewCandidate> kept;
    for (size_t i = 0; i < waiting_.size(); i += 2) kept.push_back(std::move(waiting_[i]));
    waiting_ = std::move(kept);
  }
  waiting_.push_back(std::move(candidate));
}

bool ViewPicker::IsNewDirection(const Eigen::Vector3d& camera_center, const Eigen::Vector3d& object_center,
                                double angle_rad) const {
  constexpr double kNewDistanceRatio = 1.5;
  const Eigen::Vector3d direction = camera_center - object_center;
  return std::all_of(taken_.begin(), taken_.end(), [&](const Taken& taken) {
    const Eigen::Vector3d other = taken.view.T_world_camera.translation() - object_center;
    const double ratio = direction.norm() / other.norm();
    const bool new_distance = ratio > kNewDistanceRatio || ratio < 1 / kNewDistanceRatio;
    return AngleBetween(direction, other) >= (new_distance ? 0.4 : 1.0) * angle_rad;
  });
}

bool ViewPicker::IsSharp(const ViewCandidate& candidate) {
  constexpr size_t kHistory = 30;
  const double sharpness = MeasureSharpness(candidate.frame->image_bgr, candidate.box_px);
  sharpness_history_.push_back(sharpness);
  if (sharpness_history_.size() > kHistory) sharpness_history_.erase(sharpness_history_.begin());
  return sharpness >= kMinSharpnessShare * Median(sharpness_history_);
}

std::vector<ObjectView> ViewPicker::Take(const ViewContext& context) {
  constexpr double kPatience = 1.6;  // a blurred view is better than a gap so many times the wanted angle
  const Eigen::Vector3d center = context.cuboid.T_world_object.translation();
  std::vector<ObjectView> views;
  for (const ViewCandidate& candidate : waiting_) {
    if (taken_.size() >= static_cast<size_t>(config_.max_views)) break;
    const bool first = taken_.size() < static_cast<size_t>(config_.first_views);
    const double angle_rad = (first ? config_.first_view_angle_deg : config_.view_angle_deg) * kRadPerDeg;
    const Eigen::Vector3d& camera_center = candidate.T_world_camera.translation();
    if (!IsNewDirection(camera_center, center, angle_rad)) continue;
    if (!IsSharp(candidate) && !IsNewDirection(camera_center, center, kPatience * angle_rad)) continue;
    if (const char* doubt = FindDoubt(candidate, context)) {
      spdlog::debug("objects: {}: {} is no view: {}", context.object.ToString(), candidate.keyframe.ToString(), doubt);
      continue;
    }
    views.push_back(MakeView(candidate, context));
    taken_.push_back({views.back(), views.back().T_world_camera});
    spdlog::debug("objects: {}: {} becomes view {}", context.object.ToString(), candidate.keyframe.ToString(),
                  taken_.size());
  }
  waiting_.clear();
  return views;
}

std::vector<ObjectView> ViewPicker::Adopt(ViewPicker&& other, ObjectId object, const Eigen::Vector3d& center_world) {
  std::vector<ObjectView> adopted;
  for (auto& [view, told_T_world_camera] : other.taken_) {
    if (taken_.size() >= static_cast<size_t>(config_.max_views)) break;
    const double angle_rad = config_.view_angle_deg * kRadPerDeg;
    if (!IsNewDirection(view.T_world_camera.translation(), center_world, angle_rad)) continue;
    view.object = object;
    taken_.push_back({view, view.T_world_camera});
    adopted.push_back(std::move(view));
  }
  for (ViewCandidate& candidate : other.waiting_) Offer(std::move(candidate));
  return adopted;
}

void ViewPicker::Correct(const Sim3<World, World>& S_new_old, const KeyframeCorrections& keyframes) {
  for (ViewCandidate& candidate : waiting_) {
    const auto corrected = keyframes.find(candidate.keyframe);
    if (corrected != keyframes.end()) candidate.T_world_camera = corrected->second.T_world_camera;
  }
  for (Taken& taken : taken_) {
    taken.told_T_world_camera = S_new_old.Moved(taken.told_T_world_camera);
    const auto corrected = keyframes.find(taken.view.keyframe);
    if (corrected == keyframes.end()) continue;
    taken.view = Moved(corrected->second.S_new_old, std::move(taken.view));  // its depths follow the scale
    taken.view.T_world_camera = corrected->second.T_world_camera;
  }
}

std::vector<ViewPose> ViewPicker::TakeCorrectedPoses(const Cuboid& cuboid) {
  constexpr double kLeastShift_px = 0.3;
  std::vector<ViewPose> poses;
  for (Taken& taken : taken_) {
    const SE3<World, Camera>& T_world_camera = taken.view.T_world_camera;
    if (LargestShift_px(cuboid, taken.view.camera, taken.told_T_world_camera, T_world_camera) < kLeastShift_px) {
      continue;
    }
    poses.push_back({taken.view.keyframe, T_world_camera});
    taken.told_T_world_camera = T_world_camera;
  }
  return poses;
}

void ViewPicker::RenameNeighbour(LandmarkKey from, LandmarkKey into) {
  for (ViewCandidate& candidate : waiting_) {
    std::replace(candidate.detected.begin(), candidate.detected.end(), from, into);
  }
}

}  // namespace romap::objects
