#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "common/stage_messages.h"
#include "server/slam/features/feature.h"
#include "server/slam/mask_zones.h"
#include "server/slam/optimize/radial_correction.h"

namespace romap::slam {

class RollingShutter;

// Finds features near a pixel.
class FeatureGrid {
 public:
  FeatureGrid() = default;
  FeatureGrid(int width_px, int height_px, const std::vector<Feature>& features);
  // Replaces `indices` by those of the features whose cells touch the square of half side `radius_px` around
  // `pixel_px`, in ascending order within a cell. Callers must check the distance.
  void Near(const Eigen::Vector2d& pixel_px, double radius_px, std::vector<int>& indices) const;

 private:
  int columns_ = 0;
  int rows_ = 0;
  std::vector<int> cell_begin_;  // first index into `members_` of each cell, and the end
  std::vector<int> members_;
};

// The features of one frame. Keyframes store them instead of the image. Immutable, so that threads can share it.
struct FrameFeatures {
  uint64_t frame_id = 0;
  int64_t timestamp_ns = 0;
  CameraModel camera = {};     // pinhole
  bool has_masks = false;      // also true when the masks arrived after the frame
  RadialCorrection lens = {};  // applied to `features` and `bearings_camera`
  // By which the image was converted, and per feature the z depth for the conversion of its pixel, in the unit of the
  // shutter's motion, 0 = unknown. null: a global shutter.
  std::shared_ptr<const RollingShutter> shutter = {};
  std::vector<double> shutter_depths_mu = {};
  std::vector<Feature> features = {};                 // pixels corrected by `lens` and by the depth in `shutter`
  std::vector<Eigen::Vector2f> image_px = {};         // per feature: its pixel in the image, before these corrections
  std::vector<Eigen::Vector3d> bearings_camera = {};  // per feature: unit length
  std::vector<double> ranges_mu = {};  // per feature: distance along the bearing from the depth image, 0 = unknown
  std::vector<float> noise =
      {};  // per feature: standard deviation of its pixel, in those of a detected feature of its octave
  std::vector<MaskZone> mask_zones = {};  // per feature
  FeatureGrid grid = {};

  size_t size() const { return features.size(); }
  bool HasDepth() const;
};

// `features`: with pixels of the image, before all corrections. `shutter`: by which the image was converted.
std::shared_ptr<const FrameFeatures> MakeFrameFeatures(const Frame& frame, std::vector<Feature> features,
                                                       const RadialCorrection& lens = {},
                                                       std::shared_ptr<const RollingShutter> shutter = nullptr);
// The same frame with its features corrected by another lens. Returns `frame` itself if it has this lens.
std::shared_ptr<const FrameFeatures> WithLens(std::shared_ptr<const FrameFeatures> frame, const RadialCorrection& lens);
// The same frame with its features at other pixels of the image, before the lens correction.
std::shared_ptr<const FrameFeatures> WithImagePixels(const FrameFeatures& frame, std::vector<Eigen::Vector2f> image_px);
// The features of an image of a rolling shutter, as those of the converted image. `depths_mu`: see
// FrameFeatures::shutter_depths_mu; empty: all unknown.
std::shared_ptr<const FrameFeatures> WithShutter(const FrameFeatures& rolling,
                                                 std::shared_ptr<const RollingShutter> shutter,
                                                 std::vector<double> depths_mu = {});
// The same frame with other shutter_depths_mu. Requires a shutter.
std::shared_ptr<const FrameFeatures> WithShutterDepths(const FrameFeatures& frame, std::vector<double> depths_mu);
// The same frame with its features labeled by masks that arrived after it, as FeatureExtractor does.
// `labels`: CV_16UC1 of the frame's size.
std::shared_ptr<const FrameFeatures> WithMasks(const FrameFeatures& frame, const cv::Mat& labels, int mask_erosion_px);
// The features with their pixels in the image, before the lens correction.
std::vector<Feature> UncorrectedFeatures(const FrameFeatures& frame);

}  // namespace romap::slam
