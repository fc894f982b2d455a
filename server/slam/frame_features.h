#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "common/stage_messages.h"
#include "server/slam/features/feature.h"
#include "server/slam/mask_places.h"
#include "server/slam/optimise/radial_correction.h"

namespace romap::slam {

// Finds features near a pixel.
class FeatureGrid {
 public:
  FeatureGrid() = default;
  FeatureGrid(int width_px, int height_px, const std::vector<Feature>& features);
  // Replaces `indices` by those of the features whose cells touch the square of half side `radius_px` around
  // `pixel_px`, in ascending order within a cell; callers check the distance.
  void Near(const Eigen::Vector2d& pixel_px, double radius_px, std::vector<int>& indices) const;

 private:
  int columns_ = 0;
  int rows_ = 0;
  std::vector<int> cell_begin_;  // of `members_`, one more than there are cells
  std::vector<int> members_;
};

// A frame as slam keeps it: without its image. Immutable once made, so that threads may share it.
struct FrameFeatures {
  uint64_t frame_id = 0;
  int64_t timestamp_ns = 0;
  CameraModel camera = {};     // pinhole
  bool has_masks = false;      // or have come since
  RadialCorrection lens = {};  // by which features and bearings were corrected
  std::vector<Feature> features = {};
  std::vector<Eigen::Vector2f> seen_px = {};          // where the picture shows them, before that
  std::vector<Eigen::Vector3d> bearings_camera = {};  // unit length; one per feature, as all below
  std::vector<double> ranges_mu = {};                 // by the depth image along the bearing, 0 = unknown
  std::vector<MaskPlace> mask_places = {};
  FeatureGrid grid = {};

  size_t size() const { return features.size(); }
  bool HasDepth() const;
};

// `features` are where the picture shows them.
std::shared_ptr<const FrameFeatures> MakeFrameFeatures(const Frame& frame, std::vector<Feature> features,
                                                       const RadialCorrection& lens = {});
// The same frame, its features corrected by another lens. The same object, if it is no other.
std::shared_ptr<const FrameFeatures> WithLens(std::shared_ptr<const FrameFeatures> sight, const RadialCorrection& lens);
// The same frame, its features labelled by masks that came after it, as FeatureExtractor does it. `labels`: CV_16UC1 of
// the frame's size.
std::shared_ptr<const FrameFeatures> WithMasks(const FrameFeatures& sight, const cv::Mat& labels, int mask_erosion_px);
// The features where the picture shows them.
std::vector<Feature> SeenFeatures(const FrameFeatures& sight);

}  // namespace romap::slam
