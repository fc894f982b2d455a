#include "server/objects/silhouette.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "common/angles.h"

namespace romap::objects {
namespace {

constexpr int kMaxColumns = 320;  // of subsampled masks, about
constexpr size_t kMaxOutlineRays = 160;

// Unit directions through the first and last pixel of the mask in each row and column of its box.
std::vector<Eigen::Vector3d> OutlineRays(const Silhouette& silhouette) {
  const int stride = silhouette.masks->stride_px;
  const cv::Mat& masks = silhouette.masks->index;
  const cv::Rect box = silhouette.box_px;
  const int left = box.x / stride;
  const int top = box.y / stride;
  const int right = std::min(masks.cols - 1, (box.x + box.width - 1) / stride);
  const int bottom = std::min(masks.rows - 1, (box.y + box.height - 1) / stride);
  std::vector<Eigen::Vector2d> outline_px;
  const auto is_mask = [&](int u, int v) { return masks.at<uint8_t>(v, u) == silhouette.index; };
  const auto add = [&](int u, int v) { outline_px.emplace_back(u * stride, v * stride); };
  for (int v = top; v <= bottom; ++v) {
    int first = left;
    int last = right;
    while (first <= right && !is_mask(first, v)) ++first;
    if (first > right) continue;
    while (!is_mask(last, v)) --last;
    add(first, v);
    add(last, v);
  }
  for (int u = left; u <= right; ++u) {
    int first = top;
    int last = bottom;
    while (first <= bottom && !is_mask(u, first)) ++first;
    if (first > bottom) continue;
    while (!is_mask(u, last)) --last;
    add(u, first);
    add(u, last);
  }
  const size_t step = outline_px.size() / kMaxOutlineRays + 1;
  std::vector<Eigen::Vector3d> rays;
  for (size_t i = 0; i < outline_px.size(); i += step) {
    const Eigen::Vector3d direction = silhouette.camera.Unproject(outline_px[i].x(), outline_px[i].y());
    rays.push_back((silhouette.T_world_camera.rotation() * direction).normalized());
  }
  return rays;
}

Eigen::Matrix<double, 3, 4> ProjectionOf(const Silhouette& silhouette) {
  const CameraModel& camera = silhouette.camera;
  const int stride = silhouette.masks->stride_px;
  Eigen::Matrix3d K;
  K << camera.fx_px / stride, 0, camera.cx_px / stride,  //
      0, camera.fy_px / stride, camera.cy_px / stride,   //
      0, 0, 1;
  return K * silhouette.T_world_camera.Inverse().Matrix().topRows<3>();
}

}  // namespace

std::shared_ptr<const KeyframeMasks> SubsampleMasks(const cv::Mat& labels, const std::vector<Detection>& detections,
                                                    const std::vector<LandmarkKey>& keys) {
  auto masks = std::make_shared<KeyframeMasks>();
  masks->stride_px = std::max(1, labels.cols / kMaxColumns);
  masks->keys = keys;
  std::vector<uint8_t> index_of_label(1 << 16, kOtherMask);
  index_of_label[0] = 0;
  for (size_t d = 0; d < std::min<size_t>(detections.size(), kOtherMask - 1); ++d) {
    index_of_label[detections[d].label] = static_cast<uint8_t>(d + 1);
  }
  const int stride = masks->stride_px;
  const cv::Size size((labels.cols + stride - 1) / stride, (labels.rows + stride - 1) / stride);
  masks->padded.create(size.height + 2, size.width + 2, CV_8UC1);
  masks->padded.setTo(kOtherMask);
  masks->index = masks->padded(cv::Rect({1, 1}, size));
  for (int v = 0; v < masks->index.rows; ++v) {
    const auto* from = labels.ptr<uint16_t>(v * stride);
    auto* to = masks->index.ptr<uint8_t>(v);
    for (int u = 0; u < masks->index.cols; ++u) to[u] = index_of_label[from[u * stride]];
  }
  return masks;
}

Silhouette MakeSilhouette(const KeyframeView& view, std::shared_ptr<const KeyframeMasks> masks,
                          const Detection& detection, size_t detection_index) {
  Silhouette silhouette{.keyframe = view.id,
                        .camera = view.frame->camera,
                        .T_world_camera = view.T_world_camera,
                        .corrected_T_world_camera = view.T_world_camera,
                        .P_image_world = {},
                        .masks = std::move(masks),
                        .index = static_cast<uint8_t>(std::min<size_t>(detection_index + 1, kOtherMask)),
                        .neighbors = {},
                        .box_px = detection.box_px,
                        .cut_by_border = detection.CutByBorder(),
                        .outline_rays_world = {},
                        .extents = MeasureExtents(view.frame->labels, detection),
                        .segments = {}};
  silhouette.P_image_world = ProjectionOf(silhouette);
  silhouette.outline_rays_world = OutlineRays(silhouette);
  return silhouette;
}

void Move(const Sim3<World, World>& S_new_old, Silhouette* silhouette) {
  const Sim3<World, World> S_old_new = S_new_old.Inverse();
  const Eigen::Matrix3d turn_and_scale = S_old_new.scale() * S_old_new.rotation().toRotationMatrix();
  auto& P = silhouette->P_image_world;
  P.col(3) += P.leftCols<3>() * S_old_new.translation();
  P.leftCols<3>() *= turn_and_scale;
  for (auto& neighbor : silhouette->neighbors) {
    if (!neighbor) continue;
    neighbor->offset += neighbor->M * S_old_new.translation();
    neighbor->M *= turn_and_scale;
  }
  silhouette->T_world_camera = S_new_old.Moved(silhouette->T_world_camera);
  for (Eigen::Vector3d& ray : silhouette->outline_rays_world) ray = S_new_old.rotation() * ray;
}

void ApplyCorrectedPose(Silhouette* silhouette) {
  const Eigen::Quaterniond turn =
      silhouette->corrected_T_world_camera.rotation() * silhouette->T_world_camera.rotation().conjugate();
  silhouette->T_world_camera = silhouette->corrected_T_world_camera;
  silhouette->P_image_world = ProjectionOf(*silhouette);
  for (Eigen::Vector3d& ray : silhouette->outline_rays_world) ray = turn * ray;
}

void UpdateNeighbors(const std::map<LandmarkKey, Cuboid>& cuboids, Silhouette* silhouette) {
  silhouette->neighbors.assign(silhouette->masks->keys.size(), std::nullopt);
  for (size_t i = 0; i < silhouette->neighbors.size(); ++i) {
    const auto found = cuboids.find(silhouette->masks->keys[i]);
    if (found == cuboids.end()) continue;
    const SE3<Object, World> T_object_world = found->second.T_world_object.Inverse();
    const Eigen::Matrix3d shrink = found->second.half_extents.cwiseInverse().asDiagonal();
    silhouette->neighbors[i] = UnitBox{shrink * T_object_world.RotationMatrix(), shrink * T_object_world.translation()};
  }
}

bool Silhouette::MayOcclude(int mask_index, const Eigen::Vector3d& p_world) const {
  const auto neighbor = static_cast<size_t>(mask_index) - 1;
  if (neighbor >= neighbors.size() || !neighbors[neighbor]) return true;
  // Whether the line from the camera (parameter 0) to the point (parameter 1) intersects the box.
  const Eigen::Vector3d from = *neighbors[neighbor] * CameraCenter();
  const Eigen::Vector3d step = *neighbors[neighbor] * p_world - from;
  const Eigen::Array3d t0 = (-1 - from.array()) / step.array();
  const Eigen::Array3d t1 = (1 - from.array()) / step.array();
  const double near = t0.min(t1).maxCoeff();
  const double far = t0.max(t1).minCoeff();
  return near <= far && far >= 0 && near <= 1;
}

bool Silhouette::IsFreeExtent(int k, const Eigen::Vector3d& center_world) const {
  const Eigen::Vector2f tip_px = extents.tip_px[static_cast<size_t>(k)];
  const Eigen::Vector2d outward = ExtentDirection(k);
  // The point at the object's distance on the ray through the tip.
  const Eigen::Vector3d direction = T_world_camera.rotation() * camera.Unproject(tip_px.x(), tip_px.y());
  const Eigen::Vector3d to_center = center_world - CameraCenter();
  const Eigen::Vector3d tip_world = CameraCenter() + direction * (to_center.dot(direction) / direction.squaredNorm());
  constexpr int kMaxGap_px = 6;  // between masks of objects that touch in the image
  for (int step_px = 1; step_px <= kMaxGap_px; ++step_px) {
    const Eigen::Vector2d pixel = tip_px.cast<double>() + step_px * outward;
    const auto u = static_cast<int>(std::lround(pixel.x() / masks->stride_px));
    const auto v = static_cast<int>(std::lround(pixel.y() / masks->stride_px));
    if (u < 0 || v < 0 || u >= masks->index.cols || v >= masks->index.rows) return false;
    const int mask_index = masks->index.at<uint8_t>(v, u);
    if (mask_index != 0 && mask_index != index && MayOcclude(mask_index, tip_world)) return false;
  }
  return true;
}

std::optional<Eigen::Vector3d> IntersectCenterRays(const std::vector<Silhouette>& silhouettes,
                                                   double min_parallax_rad) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> directions;
  for (const Silhouette& silhouette : silhouettes) {
    if (silhouette.cut_by_border) continue;
    const double u_px = silhouette.box_px.x + (silhouette.box_px.width - 1) / 2.0;
    const double v_px = silhouette.box_px.y + (silhouette.box_px.height - 1) / 2.0;
    const Eigen::Vector3d direction =
        (silhouette.T_world_camera.rotation() * silhouette.camera.Unproject(u_px, v_px)).normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - direction * direction.transpose();
    A += across;
    b += across * silhouette.CameraCenter();
    directions.push_back(direction);
  }
  double parallax = 0;
  for (const Eigen::Vector3d& direction : directions) {
    parallax = std::max(parallax, AngleBetween(direction, directions.front()));
  }
  if (directions.size() < 2 || parallax < min_parallax_rad) return std::nullopt;
  const Eigen::Vector3d center = A.ldlt().solve(b);
  if (!center.allFinite()) return std::nullopt;
  for (const Silhouette& silhouette : silhouettes) {
    if (silhouette.cut_by_border) continue;
    if ((silhouette.T_world_camera.Inverse() * center).z() <= 0) return std::nullopt;
  }
  return center;
}

double ParallaxRad(const std::vector<Silhouette>& silhouettes, const Eigen::Vector3d& p_world) {
  std::vector<Eigen::Vector3d> directions;
  directions.reserve(silhouettes.size());
  for (const Silhouette& silhouette : silhouettes) {
    directions.push_back((silhouette.CameraCenter() - p_world).normalized());
  }
  // Compares cosines, because there are many pairs and an angle is expensive.
  double min_cosine = 1;
  double largest = 0;
  for (size_t i = 0; i < directions.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      const double cosine = directions[i].dot(directions[j]);
      if (cosine >= min_cosine) continue;
      min_cosine = cosine;
      largest = AngleBetween(directions[i], directions[j]);
    }
  }
  return largest;
}

}  // namespace romap::objects
