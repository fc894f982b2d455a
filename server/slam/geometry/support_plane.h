#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>

namespace romap::slam {

// A map point that may lie on the support plane.
struct SupportPoint {
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();
  double sigma_mu = 0;       // uncertainty of its position
  bool near_object = false;  // observed outside of a mask but close to it
};

struct SupportPlane {
  Eigen::Vector3d normal_world = Eigen::Vector3d::UnitZ();  // unit length, up
  double offset_mu = 0;                                     // normal . p = offset on the plane
  double sigma_rad = 0;                                     // standard deviation of the normal's direction
  double confidence = 0;                                    // 0..1
  int inliers = 0;
};

struct SupportPlaneQuery {
  std::span<const SupportPoint> points;
  std::span<const Eigen::Vector3d> object_points_world;   // of the objects, which are above their support
  std::span<const Eigen::Vector3d> camera_centers_world;  // also above it
  std::span<const Eigen::Vector3d> camera_ups_world;      // -y of the cameras: up is within 75 degrees of their mean
  uint64_t seed = 1;
};

// Finds the plane that supports the objects; its normal is the up direction. nullopt: no plane can support them.
std::optional<SupportPlane> FindSupportPlane(const SupportPlaneQuery& query);

}  // namespace romap::slam
