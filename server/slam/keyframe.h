#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "common/messages.h"
#include "server/slam/features/feature.h"

namespace romap {

// Finds features near a pixel.
class FeatureGrid {
 public:
  FeatureGrid() = default;
  FeatureGrid(int width_px, int height_px, const std::vector<Feature>& features);
  // Appends the indices of the features whose cells touch the square of half side `radius_px` around `pixel_px`, in
  // ascending order within a cell; callers check the distance.
  void Near(const Eigen::Vector2d& pixel_px, double radius_px, std::vector<int>& indices) const;

 private:
  int columns_ = 0;
  int rows_ = 0;
  std::vector<std::vector<int>> cells_;
};

// A keyframe as the sparse map keeps it: without its image.
struct MapKeyframe {
  KeyframeId id;
  CameraModel camera = {};
  SE3<World, Camera> T_world_camera = {};
  SE3<Camera, World> T_camera_world = {};
  std::vector<Feature> features = {};
  std::vector<Eigen::Vector3d> bearings_world = {};  // unit length, one per feature
  std::vector<double> ranges_mu = {};   // by the depth image along the bearing, 0 = unknown; one per feature
  std::vector<MapPointId> points = {};  // one per feature, 0 = none
  FeatureGrid grid = {};

  Eigen::Vector3d center_world() const { return T_world_camera.translation(); }
};

MapKeyframe MakeMapKeyframe(KeyframeId id, const Frame& frame, const SE3<World, Camera>& T_world_camera,
                            std::vector<Feature> features);

}  // namespace romap
