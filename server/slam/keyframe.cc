#include "server/slam/keyframe.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace romap {
namespace {

constexpr int kCell_px = 16;
constexpr float kMaxDepthJump = 0.02F;  // over depth, in a 3x3 neighbourhood

// Distance along the feature's ray by the depth image, 0 where there is none or where the surface jumps.
double RangeAt(const cv::Mat& depth_mu, const CameraModel& camera, const Feature& feature) {
  const int u = static_cast<int>(std::lround(feature.pixel_px.x()));
  const int v = static_cast<int>(std::lround(feature.pixel_px.y()));
  if (u < 1 || v < 1 || u + 1 >= depth_mu.cols || v + 1 >= depth_mu.rows) return 0;
  const float center_mu = depth_mu.at<float>(v, u);
  for (int dv = -1; dv <= 1; ++dv) {
    for (int du = -1; du <= 1; ++du) {
      const float z_mu = depth_mu.at<float>(v + dv, u + du);
      if (!(z_mu > 0) || std::abs(z_mu - center_mu) > kMaxDepthJump * center_mu) return 0;
    }
  }
  return center_mu * camera.Unproject(feature.pixel_px.x(), feature.pixel_px.y()).norm();
}

}  // namespace

FeatureGrid::FeatureGrid(int width_px, int height_px, const std::vector<Feature>& features)
    : columns_(width_px / kCell_px + 1),
      rows_(height_px / kCell_px + 1),
      cells_(static_cast<size_t>(columns_) * static_cast<size_t>(rows_)) {
  for (size_t i = 0; i < features.size(); ++i) {
    const int column = std::clamp(static_cast<int>(features[i].pixel_px.x()) / kCell_px, 0, columns_ - 1);
    const int row = std::clamp(static_cast<int>(features[i].pixel_px.y()) / kCell_px, 0, rows_ - 1);
    cells_[static_cast<size_t>(row * columns_ + column)].push_back(static_cast<int>(i));
  }
}

void FeatureGrid::Near(const Eigen::Vector2d& pixel_px, double radius_px, std::vector<int>& indices) const {
  const auto cell = [](double px, int count) {
    return static_cast<int>(std::clamp(px / kCell_px, 0.0, static_cast<double>(count - 1)));
  };
  for (int row = cell(pixel_px.y() - radius_px, rows_); row <= cell(pixel_px.y() + radius_px, rows_); ++row) {
    for (int col = cell(pixel_px.x() - radius_px, columns_); col <= cell(pixel_px.x() + radius_px, columns_); ++col) {
      const std::vector<int>& members = cells_[static_cast<size_t>(row * columns_ + col)];
      indices.insert(indices.end(), members.begin(), members.end());
    }
  }
}

MapKeyframe MakeMapKeyframe(KeyframeId id, const Frame& frame, const SE3<World, Camera>& T_world_camera,
                            std::vector<Feature> features) {
  MapKeyframe keyframe{.id = id,
                       .camera = frame.camera,
                       .T_world_camera = T_world_camera,
                       .T_camera_world = T_world_camera.Inverse(),
                       .features = std::move(features)};
  keyframe.bearings_world.reserve(keyframe.features.size());
  keyframe.ranges_mu.reserve(keyframe.features.size());
  for (const Feature& feature : keyframe.features) {
    const Eigen::Vector3d ray_camera = frame.camera.Unproject(feature.pixel_px.x(), feature.pixel_px.y());
    keyframe.bearings_world.push_back(T_world_camera.rotation() * ray_camera.normalized());
    keyframe.ranges_mu.push_back(RangeAt(frame.depth_mu, frame.camera, feature));
  }
  keyframe.points.resize(keyframe.features.size());
  keyframe.grid = FeatureGrid(frame.camera.width_px, frame.camera.height_px, keyframe.features);
  return keyframe;
}

}  // namespace romap
