#include "server/objects/view_picker.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "common/angles.h"
#include "common/image_sharpness.h"
#include "common/map_motion.h"
#include "common/statistics.h"
#include "server/objects/projection.h"

namespace romap::objects {
namespace {

constexpr double kMinSharpnessShare = 0.6;   // of the object's median sharpness; below it a candidate is blurred
constexpr size_t kMaxWaitingKeyframes = 24;  // kept until the object has a cuboid

// Reason why the candidate's mask does not fit the object; nullptr if it fits.
const char* FindDoubt(const ViewCandidate& candidate, const ViewContext& context) {
  constexpr double kMinInImage = 0.6;         // share of the body points
  constexpr double kMinInsidePerOutside = 3;  // body points in the mask, per point on the background
  constexpr double kMinVisible = 0.4;         // share of the body points in the image that are in the mask
  constexpr double kCuboidEnlargement = 1.3;  // of the half extents: an early cuboid may be too small
  constexpr double kMinInCuboid = 0.75;       // share of the area of the mask's box
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
  if (in_image < kMinInImage * static_cast<double>(context.body_world.size()))
    return "most of the object is outside the image";
  if (inside < kMinInsidePerOutside * outside) return "mask covers too little of the object";
  if (inside < kMinVisible * in_image) return "mostly occluded";
  const cv::Rect expected = ProjectCuboid(context.cuboid, kCuboidEnlargement, camera, candidate.T_world_camera);
  const double covered = (expected & candidate.box_px).area();
  if (covered < kMinInCuboid * candidate.box_px.area()) return "the mask extends beyond the cuboid";
  return nullptr;
}

// The part of the image to train on: the mask and the cuboid, both with a margin of background.
cv::Rect CropFor(const ViewCandidate& candidate, const Cuboid& cuboid) {
  constexpr int kMinMargin_px = 8;
  constexpr int kBoxPerMargin = 10;           // longer side of the mask's box, per additional margin
  constexpr double kCuboidEnlargement = 1.5;  // of the half extents
  const CameraModel& camera = candidate.frame->camera;
  const int margin_px = kMinMargin_px + std::max(candidate.box_px.width, candidate.box_px.height) / kBoxPerMargin;
  const cv::Point margin(margin_px, margin_px);
  const cv::Rect around_mask(candidate.box_px.tl() - margin, candidate.box_px.br() + margin);
  const cv::Rect around_cuboid = ProjectCuboid(cuboid, kCuboidEnlargement, camera, candidate.T_world_camera);
  return (around_mask | around_cuboid) & cv::Rect(0, 0, camera.width_px, camera.height_px);
}

// Marks the pixels of neighbors in front of the object that the detector missed: they are not background.
void MarkMissedNeighbors(const ViewCandidate& candidate, const ViewContext& context, cv::Mat* occluded) {
  const SE3<Camera, World> T_camera_world = candidate.T_world_camera.Inverse();
  const double own_depth = (T_camera_world * context.cuboid.T_world_object.translation()).z();
  for (const ViewContext::Neighbor& neighbor : context.neighbors) {
    const auto& detected = candidate.detected;
    if (std::find(detected.begin(), detected.end(), neighbor.key) != detected.end()) continue;
    if ((T_camera_world * neighbor.cuboid.T_world_object.translation()).z() >= own_depth) continue;
    if (ProjectCuboid(neighbor.cuboid, 1, candidate.frame->camera, candidate.T_world_camera).empty()) continue;
    std::vector<cv::Point> corners;
    for (const Eigen::Vector3d& corner : CuboidCorners(neighbor.cuboid)) {
      const Eigen::Vector2d pixel = candidate.frame->camera.Project(T_camera_world * corner);
      corners.emplace_back(static_cast<int>(std::lround(pixel.x())), static_cast<int>(std::lround(pixel.y())));
    }
    std::vector<cv::Point> outline;
    cv::convexHull(corners, outline);
    cv::fillConvexPoly(*occluded, outline, cv::Scalar(1));
  }
}

// Labels of neighbors entirely behind the object: their rays pass through the object's box without ending in it, like
// background rays.
std::vector<uint16_t> LabelsBehind(const ViewCandidate& candidate, const ViewContext& context) {
  const SE3<Camera, World> T_camera_world = candidate.T_world_camera.Inverse();
  const double far_depth = DepthRange(context.cuboid, T_camera_world).second;
  std::vector<uint16_t> labels;
  for (size_t i = 0; i < candidate.detected.size(); ++i) {
    const auto neighbor = std::find_if(context.neighbors.begin(), context.neighbors.end(),
                                       [&](const auto& n) { return n.key == candidate.detected[i]; });
    if (neighbor == context.neighbors.end()) continue;
    if (DepthRange(neighbor->cuboid, T_camera_world).first > far_depth) labels.push_back(candidate.detected_labels[i]);
  }
  return labels;
}

// Classifies each ray through the crop: CV_8UC1 of RayKind.
cv::Mat ClassifyRays(const ViewCandidate& candidate, const ViewContext& context, const cv::Rect& roi) {
  cv::Mat occluded = cv::Mat::zeros(candidate.frame->labels.size(), CV_8UC1);
  MarkMissedNeighbors(candidate, context, &occluded);
  std::vector<RayKind> kind_of_label(1 << 16, RayKind::kOccluder);
  kind_of_label[0] = RayKind::kBackground;
  for (uint16_t label : LabelsBehind(candidate, context)) kind_of_label[label] = RayKind::kBackground;
  kind_of_label[candidate.label] = RayKind::kObject;
  cv::Mat kinds(roi.size(), CV_8UC1);
  for (int v = 0; v < roi.height; ++v) {
    const auto* labels = candidate.frame->labels.ptr<uint16_t>(roi.y + v) + roi.x;
    const auto* occluded_row = occluded.ptr<uint8_t>(roi.y + v) + roi.x;
    auto* kind = kinds.ptr<uint8_t>(v);
    for (int u = 0; u < roi.width; ++u) {
      const bool may_be_occluded = labels[u] == 0 && occluded_row[u] != 0;
      kind[u] = static_cast<uint8_t>(may_be_occluded ? RayKind::kOccluder : kind_of_label[labels[u]]);
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
  // The pixels are copied, because a region of an image keeps the whole image in memory.
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

// 0 if the box is outside the image.
double SharpnessInBox(const cv::Mat& image_bgr, const cv::Rect& box_px) {
  const cv::Rect box = box_px & cv::Rect({}, image_bgr.size());
  return box.empty() ? 0 : ImageSharpness(image_bgr(box));
}

}  // namespace

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
  constexpr double kNewDistanceRatio = 1.5;       // of the distances to the object
  constexpr double kAngleFactorAtDistance = 0.4;  // of the angle, for a view from a new distance
  const Eigen::Vector3d direction = camera_center - object_center;
  return std::all_of(picked_.begin(), picked_.end(), [&](const Picked& picked) {
    const Eigen::Vector3d other = picked.view.T_world_camera.translation() - object_center;
    const double ratio = direction.norm() / other.norm();
    const bool new_distance = ratio > kNewDistanceRatio || ratio < 1 / kNewDistanceRatio;
    return AngleBetween(direction, other) >= (new_distance ? kAngleFactorAtDistance : 1.0) * angle_rad;
  });
}

bool ViewPicker::IsSharp(const ViewCandidate& candidate) {
  constexpr size_t kHistory = 30;  // candidates
  const double sharpness = SharpnessInBox(candidate.frame->image_bgr, candidate.box_px);
  sharpness_history_.push_back(sharpness);
  if (sharpness_history_.size() > kHistory) sharpness_history_.erase(sharpness_history_.begin());
  return sharpness >= kMinSharpnessShare * Median(sharpness_history_);
}

std::vector<ObjectView> ViewPicker::Take(const ViewContext& context) {
  constexpr double kMaxGapFactor = 1.6;  // of the angle: a blurred view is better than a wider gap
  const Eigen::Vector3d center = context.cuboid.T_world_object.translation();
  std::vector<ObjectView> views;
  for (const ViewCandidate& candidate : waiting_) {
    if (picked_.size() >= static_cast<size_t>(config_.max_views)) break;
    const bool first = picked_.size() < static_cast<size_t>(config_.first_views);
    const double angle_rad = (first ? config_.first_view_angle_deg : config_.view_angle_deg) * kRadPerDeg;
    const Eigen::Vector3d& camera_center = candidate.T_world_camera.translation();
    if (!IsNewDirection(camera_center, center, angle_rad)) continue;
    if (!IsSharp(candidate) && !IsNewDirection(camera_center, center, kMaxGapFactor * angle_rad)) continue;
    if (const char* doubt = FindDoubt(candidate, context)) {
      spdlog::debug("objects: {}: {} rejected as a training view: {}", context.object.ToString(),
                    candidate.keyframe.ToString(), doubt);
      continue;
    }
    views.push_back(MakeView(candidate, context));
    picked_.push_back({views.back(), views.back().T_world_camera});
    spdlog::debug("objects: {}: {} is training view {}", context.object.ToString(), candidate.keyframe.ToString(),
                  picked_.size());
  }
  waiting_.clear();
  return views;
}

std::vector<ObjectView> ViewPicker::Adopt(ViewPicker&& other, ObjectId object, const Eigen::Vector3d& center_world) {
  std::vector<ObjectView> adopted;
  for (auto& [view, sent_T_world_camera] : other.picked_) {
    if (picked_.size() >= static_cast<size_t>(config_.max_views)) break;
    const double angle_rad = config_.view_angle_deg * kRadPerDeg;
    if (!IsNewDirection(view.T_world_camera.translation(), center_world, angle_rad)) continue;
    view.object = object;
    picked_.push_back({view, view.T_world_camera});
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
  for (Picked& picked : picked_) {
    picked.sent_T_world_camera = S_new_old.Moved(picked.sent_T_world_camera);
    const auto corrected = keyframes.find(picked.view.keyframe);
    if (corrected == keyframes.end()) continue;
    picked.view = Moved(corrected->second.S_new_old, std::move(picked.view));  // scales its depths
    picked.view.T_world_camera = corrected->second.T_world_camera;
  }
}

std::vector<ViewPose> ViewPicker::TakeCorrectedPoses(const Cuboid& cuboid) {
  constexpr double kMinShift_px = 0.3;  // of a corner of the cuboid
  std::vector<ViewPose> poses;
  for (Picked& picked : picked_) {
    const SE3<World, Camera>& T_world_camera = picked.view.T_world_camera;
    if (LargestShift_px(cuboid, picked.view.camera, picked.sent_T_world_camera, T_world_camera) < kMinShift_px) {
      continue;
    }
    poses.push_back({picked.view.keyframe, T_world_camera});
    picked.sent_T_world_camera = T_world_camera;
  }
  return poses;
}

void ViewPicker::RenameNeighbor(LandmarkKey from, LandmarkKey into) {
  for (ViewCandidate& candidate : waiting_) {
    std::replace(candidate.detected.begin(), candidate.detected.end(), from, into);
  }
}

}  // namespace romap::objects
