#include "server/slam/frame_features.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/label_image.h"
#include "server/slam/rolling_shutter.h"

namespace romap::slam {
namespace {

constexpr int kCell_px = 16;
constexpr float kMaxDepthJump = 0.02F;  // relative to the depth, in a 3x3 neighborhood

// z depth at a feature; 0 if the depth there is unknown or discontinuous.
double DepthAt(const cv::Mat& depth_mu, const Feature& feature) {
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
  return center_mu;
}

// Computes everything that depends on `image_px`, `lens` and `shutter_depths_mu`.
void UpdatePositions(FrameFeatures& frame) {
  const CameraModel& camera = frame.camera;
  for (size_t i = 0; i < frame.size(); ++i) {
    const double depth_mu = frame.ranges_mu[i] * frame.bearings_camera[i].z();
    Eigen::Vector2d pixel_px = frame.lens.Undistort(camera, frame.image_px[i].cast<double>());
    if (frame.shutter) {
      const double shutter_depth_mu = frame.shutter_depths_mu[i] > 0 ? frame.shutter_depths_mu[i] : depth_mu;
      if (shutter_depth_mu > 0) pixel_px = frame.shutter->FromConverted(pixel_px, shutter_depth_mu);
    }
    const Eigen::Vector3d ray = camera.Unproject(pixel_px.x(), pixel_px.y());
    frame.features[i].pixel_px = pixel_px.cast<float>();
    frame.bearings_camera[i] = ray.normalized();
    frame.ranges_mu[i] = depth_mu * ray.norm();
  }
  frame.grid = FeatureGrid(camera.width_px, camera.height_px, frame.features);
}

}  // namespace

FeatureGrid::FeatureGrid(int width_px, int height_px, const std::vector<Feature>& features)
    : columns_(width_px / kCell_px + 1),
      rows_(height_px / kCell_px + 1),
      cell_begin_(static_cast<size_t>(columns_) * static_cast<size_t>(rows_) + 1, 0),
      members_(features.size()) {
  std::vector<size_t> cell_of(features.size());
  for (size_t i = 0; i < features.size(); ++i) {
    const int column = std::clamp(static_cast<int>(features[i].pixel_px.x()) / kCell_px, 0, columns_ - 1);
    const int row = std::clamp(static_cast<int>(features[i].pixel_px.y()) / kCell_px, 0, rows_ - 1);
    cell_of[i] = static_cast<size_t>(row * columns_ + column);
    ++cell_begin_[cell_of[i] + 1];
  }
  for (size_t cell = 1; cell < cell_begin_.size(); ++cell) cell_begin_[cell] += cell_begin_[cell - 1];
  std::vector<int> next(cell_begin_.begin(), cell_begin_.end() - 1);
  for (size_t i = 0; i < features.size(); ++i) members_[static_cast<size_t>(next[cell_of[i]]++)] = static_cast<int>(i);
}

void FeatureGrid::Near(const Eigen::Vector2d& pixel_px, double radius_px, std::vector<int>& indices) const {
  indices.clear();
  const auto cell = [](double px, int count) {
    return static_cast<int>(std::clamp(px / kCell_px, 0.0, static_cast<double>(count - 1)));
  };
  const int first_column = cell(pixel_px.x() - radius_px, columns_);
  const int last_column = cell(pixel_px.x() + radius_px, columns_);
  for (int row = cell(pixel_px.y() - radius_px, rows_); row <= cell(pixel_px.y() + radius_px, rows_); ++row) {
    // The cells of a row are contiguous.
    const int begin = cell_begin_[static_cast<size_t>(row * columns_ + first_column)];
    const int end = cell_begin_[static_cast<size_t>(row * columns_ + last_column + 1)];
    indices.insert(indices.end(), members_.begin() + begin, members_.begin() + end);
  }
}

bool FrameFeatures::HasDepth() const {
  return std::any_of(ranges_mu.begin(), ranges_mu.end(), [](double range_mu) { return range_mu > 0; });
}

std::shared_ptr<const FrameFeatures> MakeFrameFeatures(const Frame& frame, std::vector<Feature> features,
                                                       const RadialCorrection& lens,
                                                       std::shared_ptr<const RollingShutter> shutter) {
  auto result = std::make_shared<FrameFeatures>();
  result->frame_id = frame.frame_id;
  result->timestamp_ns = frame.timestamp_ns;
  result->camera = frame.camera;
  result->features = std::move(features);
  const size_t count = result->features.size();
  result->ranges_mu.assign(count, 0);
  result->has_masks = frame.has_masks;
  const MaskZones zones(frame.labels);
  for (size_t i = 0; i < count; ++i) {
    const Feature& feature = result->features[i];
    result->image_px.push_back(feature.pixel_px);
    const Eigen::Vector3d ray = frame.camera.Unproject(feature.pixel_px.x(), feature.pixel_px.y());
    result->bearings_camera.push_back(ray.normalized());
    if (!frame.depth_mu.empty()) result->ranges_mu[i] = DepthAt(frame.depth_mu, feature) * ray.norm();
    result->mask_zones.push_back(zones.At(feature.pixel_px, feature.octave_scale, feature.label));
  }
  result->grid = FeatureGrid(frame.camera.width_px, frame.camera.height_px, result->features);
  result->shutter = std::move(shutter);
  result->shutter_depths_mu.assign(count, 0);
  result->lens = lens;
  if (result->shutter || lens != RadialCorrection{}) UpdatePositions(*result);
  return result;
}

std::shared_ptr<const FrameFeatures> WithLens(std::shared_ptr<const FrameFeatures> frame,
                                              const RadialCorrection& lens) {
  if (frame->lens == lens) return frame;
  auto corrected = std::make_shared<FrameFeatures>(*frame);
  corrected->lens = lens;
  UpdatePositions(*corrected);
  return corrected;
}

std::shared_ptr<const FrameFeatures> WithImagePixels(const FrameFeatures& frame,
                                                     std::vector<Eigen::Vector2f> image_px) {
  auto moved = std::make_shared<FrameFeatures>(frame);
  moved->image_px = std::move(image_px);
  UpdatePositions(*moved);
  return moved;
}

std::shared_ptr<const FrameFeatures> WithShutter(const FrameFeatures& rolling,
                                                 std::shared_ptr<const RollingShutter> shutter,
                                                 std::vector<double> depths_mu) {
  auto converted = std::make_shared<FrameFeatures>(rolling);
  for (Eigen::Vector2f& px : converted->image_px) px = shutter->ToGlobal(px.cast<double>(), 0).cast<float>();
  converted->shutter = std::move(shutter);
  converted->shutter_depths_mu = std::move(depths_mu);
  converted->shutter_depths_mu.resize(rolling.size(), 0);
  UpdatePositions(*converted);
  return converted;
}

std::shared_ptr<const FrameFeatures> WithShutterDepths(const FrameFeatures& frame, std::vector<double> depths_mu) {
  auto moved = std::make_shared<FrameFeatures>(frame);
  moved->shutter_depths_mu = std::move(depths_mu);
  UpdatePositions(*moved);
  return moved;
}

std::shared_ptr<const FrameFeatures> WithMasks(const FrameFeatures& frame, const cv::Mat& labels, int mask_erosion_px) {
  auto masked = std::make_shared<FrameFeatures>(frame);
  masked->has_masks = true;
  const MaskZones zones(labels);
  for (size_t i = 0; i < frame.size(); ++i) {
    Feature& feature = masked->features[i];
    const auto erosion_px = static_cast<int>(std::lround(mask_erosion_px * feature.octave_scale));
    feature.label = LabelAt(labels, frame.image_px[i], erosion_px);
    masked->mask_zones[i] = zones.At(frame.image_px[i], feature.octave_scale, feature.label);
  }
  return masked;
}

std::vector<Feature> UncorrectedFeatures(const FrameFeatures& frame) {
  std::vector<Feature> features = frame.features;
  for (size_t i = 0; i < features.size(); ++i) features[i].pixel_px = frame.image_px[i];
  return features;
}

}  // namespace romap::slam
