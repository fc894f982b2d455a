#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/field_snapshot.h"
#include "server/mesh/field_grid.h"

namespace romap::mesh {

// The depth of the first surface of a grid in one training view: a reduced image with about one pixel per node.
class ViewDepth {
 public:
  // Where a point lies on the ray of its pixel.
  enum class Relation {
    kUnknown,  // outside the crop, or its pixel shows an occluder
    kInFront,  // before the first surface, or the ray hits none: the view observes empty space
    kBehind,   // in or behind the first surface
  };

  // `optical_depth`: of one step of the smallest node spacing at each node (NodeOpticalDepths). A ray hits the
  // surface where its optical depth exceeds `max_optical_depth`.
  ViewDepth(const FieldGrid& grid, const std::vector<float>& optical_depth, float max_optical_depth,
            const TrainingCamera& view);

  Relation Relate(const Eigen::Vector3f& p_object) const;

 private:
  Eigen::Vector2f PixelAt(int x, int y) const;
  Eigen::Vector3f DirectionAt(int x, int y) const;
  float March(const FieldGrid& grid, const std::vector<float>& optical_depth, float max_optical_depth,
              const Eigen::Vector3f& direction_object) const;

  Eigen::Matrix3f R_camera_object_;
  Eigen::Vector3f t_camera_object_;
  Eigen::Vector3f center_object_;
  Eigen::Vector2f focal_px_, center_px_, low_px_;  // of the full image; `low_px_`: corner of the crop
  float stride_px_ = 1;                            // of the full image, per pixel of the depth image
  Eigen::Vector2i size_ = Eigen::Vector2i::Zero();
  std::vector<float> distance_mu_;  // from the camera; NaN: unknown, infinite: the ray hits no surface
};

}  // namespace romap::mesh
