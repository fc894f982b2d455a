#include "server/objects/silhouette.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "server/objects/angles.h"

namespace romap {
namespace {

constexpr int kThinnedColumns = 320;
constexpr size_t kMaxOutlineRays = 160;

// Directions through the first and last pixel of the mask in each row and column of its box.
std::vector<Eigen::Vector3d> OutlineRays(const Silhouette& silhouette) {
  const int stride = silhouette.thinned.stride_px;
  const cv::Mat& labels = silhouette.thinned.labels;
  const cv::Rect box = silhouette.box_px;
  const int left = box.x / stride;
  const int top = box.y / stride;
  const int right = std::min(labels.cols - 1, (box.x + box.width - 1) / stride);
  const int bottom = std::min(labels.rows - 1, (box.y + box.height - 1) / stride);
  std::vector<Eigen::Vector2d> rim_px;
  const auto is_mask = [&](int u, int v) { return labels.at<uint16_t>(v, u) == silhouette.label; };
  const auto add = [&](int u, int v) { rim_px.emplace_back(u * stride, v * stride); };
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
  const size_t step = rim_px.size() / kMaxOutlineRays + 1;
  std::vector<Eigen::Vector3d> rays;
  for (size_t i = 0; i < rim_px.size(); i += step) {
    const Eigen::Vector3d direction = silhouette.camera.Unproject(rim_px[i].x(), rim_px[i].y());
    rays.push_back((silhouette.T_world_camera.rotation() * direction).normalized());
  }
  return rays;
}

}  // namespace

ThinnedLabels ThinLabels(const cv::Mat& labels) {
  ThinnedLabels thinned;
  thinned.stride_px = std::max(1, labels.cols / kThinnedColumns);
  const int stride = thinned.stride_px;
  thinned.labels.create((labels.rows + stride - 1) / stride, (labels.cols + stride - 1) / stride, CV_16UC1);
  for (int v = 0; v < thinned.labels.rows; ++v) {
    const auto* from = labels.ptr<uint16_t>(v * stride);
    auto* to = thinned.labels.ptr<uint16_t>(v);
    for (int u = 0; u < thinned.labels.cols; ++u) to[u] = from[u * stride];
  }
  return thinned;
}

Silhouette MakeSilhouette(const KeyframeView& view, const ThinnedLabels& thinned, const Detection& detection) {
  Silhouette silhouette{.keyframe = view.id,
                        .camera = view.frame->camera,
                        .T_world_camera = view.T_world_camera,
                        .P_image_world = {},
                        .thinned = thinned,
                        .label = detection.label,
                        .box_px = detection.box_px,
                        .cut_by_border = detection.CutByBorder(),
                        .outline_rays_world = {}};
  const CameraModel& camera = silhouette.camera;
  Eigen::Matrix3d K;
  K << camera.fx_px / thinned.stride_px, 0, camera.cx_px / thinned.stride_px,  //
      0, camera.fy_px / thinned.stride_px, camera.cy_px / thinned.stride_px,   //
      0, 0, 1;
  silhouette.P_image_world = K * view.T_world_camera.Inverse().Matrix().topRows<3>();
  silhouette.outline_rays_world = OutlineRays(silhouette);
  return silhouette;
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
  double largest = 0;
  for (size_t i = 0; i < silhouettes.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      largest = std::max(
          largest, AngleBetween(silhouettes[i].CameraCenter() - p_world, silhouettes[j].CameraCenter() - p_world));
    }
  }
  return largest;
}

}  // namespace romap
