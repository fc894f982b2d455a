#pragma once

// The trained field of one object, passed from nerf to mesh.

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

#include "common/camera_model.h"
#include "common/geometry.h"
#include "common/ids.h"
#include "common/mesh.h"

namespace romap {

// Evaluates a trained field. Immutable, safe to share between threads.
class FieldSampler {
 public:
  virtual ~FieldSampler() = default;
  // raw[i] = value of the field at p_object[i] (Object frame, map units) in the field's own unit (log density, signed
  // distance, ...). It increases inward; the surface is where it crosses FieldSnapshot::surface_level. SurfaceOptics
  // converts it to density. Points outside the box get -1e4. rgb is empty (colors are not needed) or as long as
  // p_object.
  virtual void Sample(std::span<const Eigen::Vector3f> p_object, std::span<float> raw, std::span<Rgb8> rgb) const = 0;
};

// Converts raw field values to density. On the outer side of the surface and close to it, the density (optical depth
// per map unit) is
//   density(raw) = surface_density_per_mu * exp((raw - surface_level) / raw_per_efold).
// For a field of log density this is exact with raw_per_efold 1. For a signed distance whose density follows a Laplace
// or logistic distribution (Yariv et al. 2021, Wang et al. 2021), raw_per_efold is the scale of that distribution.
struct SurfaceOptics {
  float surface_density_per_mu = 0;  // > 0
  float raw_per_efold = 1;           // > 0
};

// The camera, the ray kinds and the colors of one training view.
struct TrainingCamera {
  SE3<Camera, Object> T_camera_object;  // map units
  CameraModel camera;                   // of the full image, without distortion
  cv::Rect roi_px;                      // the crop in the full image; pixels outside it are unknown
  cv::Mat ray_kind;                     // CV_8UC1 of RayKind, size of roi_px
  cv::Mat color_bgr = {};               // CV_8UC3, size of roi_px
};

// Bits over a regular grid of the box: cell (x, y, z) is at index (z * resolution + y) * resolution + x. The cells
// divide the box evenly, from -box_half_extents to +box_half_extents.
struct OccupancyBits {
  int resolution = 0;
  std::vector<uint8_t> bits;  // 1 = possibly occupied
};

struct FieldSnapshot {
  ObjectId object;
  uint64_t steps = 0;        // optimization steps done
  double train_seconds = 0;  // wall time inside training slices
  double loss = 0;           // mean color loss of the last slice
  int views = 0;
  // Product of all corrections of the object's space since its first ObjectViews. Comparing it with the current product
  // gives the motion of everything that was computed from this snapshot.
  Sim3<World, World> S_new_first;
  bool converged = false;  // no further training unless a new view arrives
  std::string warning;     // human-readable: problems with the object's input; empty = none
  SE3<World, Object> T_world_object;
  Eigen::Vector3f box_half_extents = Eigen::Vector3f::Zero();  // of the trained box (cuboid enlarged), map units
  float surface_level = 0;                                     // raw value at the surface, see FieldSampler
  SurfaceOptics optics;
  // Inside cells that are connected through values above this lower level belong to one component (thin parts).
  float connect_level = 0;
  OccupancyBits hull;                   // visual hull of the masks: everything outside it is empty
  std::vector<TrainingCamera> cameras;  // the training views
  std::shared_ptr<const FieldSampler> field;
};

}  // namespace romap
