#include "server/slam/rolling_shutter.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "common/lens.h"
#include "server/slam/optimize/lie.h"

namespace romap::slam {
namespace {

constexpr int kMapCell_px = 8;  // the pixel map is smooth: it is interpolated between points at this distance

cv::Mat Remap(const cv::Mat& image, const cv::Mat& map, int interpolation, int border) {
  cv::Mat converted;
  if (!image.empty()) cv::remap(image, converted, map, {}, interpolation, border);
  return converted;
}

}  // namespace

RollingShutter::RollingShutter(const Frame& frame, const ReadoutMotion& motion)
    : camera_(frame.camera), source_camera_(frame.source_camera), motion_(motion) {}

double RollingShutter::ReadAt(const Eigen::Vector2d& rolling_px) const {
  const double row = source_camera_.HasDistortion() ? DistortPixel(source_camera_, rolling_px).y() : rolling_px.y();
  const double last_row = camera_.height_px - 1;
  if (!std::isfinite(row)) return 0;
  return std::clamp(row, 0.0, last_row) / last_row - 0.5;
}

// p_global = Exp(s * motion) * p_rolling.
Eigen::Vector2d RollingShutter::ToGlobal(const Eigen::Vector2d& rolling_px, double depth_mu) const {
  const double s = ReadAt(rolling_px);
  const double z_mu = DepthOr(depth_mu);
  Eigen::Vector3d p = ExpRotation(s * motion_.rotation_rad) * camera_.Unproject(rolling_px.x(), rolling_px.y());
  if (z_mu > 0) p += s / z_mu * motion_.translation_mu;
  return p.z() > 0 ? camera_.Project(p) : rolling_px;
}

Eigen::Vector2d RollingShutter::ToRolling(const Eigen::Vector2d& global_px, double depth_mu) const {
  constexpr int kMaxIterations = 10;
  constexpr double kTolerance_px = 1e-3;
  const double z_mu = DepthOr(depth_mu);
  const Eigen::Vector3d ray = camera_.Unproject(global_px.x(), global_px.y());
  Eigen::Vector2d rolling_px = global_px;
  for (int i = 0; i < kMaxIterations; ++i) {
    const double s = ReadAt(rolling_px);
    Eigen::Vector3d p = ray;
    if (z_mu > 0) p -= s / z_mu * motion_.translation_mu;
    p = ExpRotation(-s * motion_.rotation_rad) * p;
    if (!(p.z() > 0)) return global_px;
    const Eigen::Vector2d next_px = camera_.Project(p);
    const double step_px = (next_px - rolling_px).norm();
    rolling_px = next_px;
    if (step_px < kTolerance_px) break;
  }
  return rolling_px;
}

std::shared_ptr<const Frame> RollingShutter::Convert(const Frame& frame, bool with_image) const {
  auto converted = std::make_shared<Frame>(frame);
  if (!with_image) {
    converted->labels = ConvertLabels(frame.labels);
    return converted;
  }
  const cv::Mat map = PixelMap();
  converted->image_bgr = Remap(frame.image_bgr, map, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  converted->source_gray = cv::Mat();
  converted->source_camera = frame.camera;
  converted->labels = Remap(frame.labels, map, cv::INTER_NEAREST, cv::BORDER_CONSTANT);
  converted->depth_mu = Remap(DepthAtMiddleRow(frame.depth_mu), map, cv::INTER_NEAREST, cv::BORDER_CONSTANT);
  return converted;
}

cv::Mat RollingShutter::ConvertLabels(const cv::Mat& labels) const {
  return labels.empty() ? labels : Remap(labels, PixelMap(), cv::INTER_NEAREST, cv::BORDER_CONSTANT);
}

cv::Mat RollingShutter::PixelMap() const {
  const int columns = (camera_.width_px - 1) / kMapCell_px + 2;
  const int rows = (camera_.height_px - 1) / kMapCell_px + 2;
  cv::Mat coarse(rows, columns, CV_32FC2);
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      const Eigen::Vector2d px = ToRolling({x * kMapCell_px, y * kMapCell_px}, 0);
      coarse.at<cv::Vec2f>(y, x) = {static_cast<float>(px.x()), static_cast<float>(px.y())};
    }
  }
  // Pixel (u, v) of the map is point (u, v) / kMapCell_px of the coarse one.
  const double step = 1.0 / kMapCell_px;
  const cv::Matx23d coarse_from_map(step, 0, 0, 0, step, 0);
  cv::Mat map;
  cv::warpAffine(coarse, map, coarse_from_map, {camera_.width_px, camera_.height_px},
                 cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
  return map;
}

cv::Mat RollingShutter::DepthAtMiddleRow(const cv::Mat& depth_mu) const {
  cv::Mat moved(depth_mu.size(), CV_32FC1);
  for (int v = 0; v < depth_mu.rows; ++v) {
    const double s = ReadAt({camera_.cx_px, v});
    const Eigen::Vector3f z_row = (ExpRotation(s * motion_.rotation_rad).toRotationMatrix().row(2)).cast<float>();
    const auto offset_mu = static_cast<float>(s * motion_.translation_mu.z());
    const Eigen::Vector3f first = camera_.Unproject(0, v).cast<float>();
    const float step = z_row.x() / static_cast<float>(camera_.fx_px);
    const float first_factor = z_row.dot(first);
    const auto* from = depth_mu.ptr<float>(v);
    auto* to = moved.ptr<float>(v);
    for (int u = 0; u < depth_mu.cols; ++u) {
      const float z_mu = from[u] * (first_factor + step * static_cast<float>(u)) + offset_mu;
      to[u] = from[u] > 0 && z_mu > 0 ? z_mu : 0;
    }
  }
  return moved;
}

std::shared_ptr<const RollingShutter> ShutterOf(const Frame& frame, std::optional<ReadoutMotion> motion,
                                                double depth_mu) {
  if (!(frame.camera.readout_s > 0) || !motion) return nullptr;
  motion->depth_mu = depth_mu;
  return std::make_shared<const RollingShutter>(frame, *motion);
}

}  // namespace romap::slam
