#pragma once

#include <Eigen/Core>
#include <optional>

#include "common/camera_model.h"
#include "common/geometry.h"
#include "common/ids.h"
#include "server/slam/features/patch.h"
#include "server/slam/optimize/radial_correction.h"
#include "server/slam/rolling_shutter.h"

namespace romap::slam {

// The appearance of a map point, to which its observations are aligned.
struct ReferencePatch {
  Patch patch;
  KeyframeId keyframe;      // it was read there
  double octave_scale = 1;  // pixels of that keyframe per grid unit of the patch
};

// Derivative of pixels in a camera by pixels in the camera `reference`, for a surface through the point that faces the
// reference camera; nullopt if the point is behind a camera.
std::optional<Eigen::Matrix2d> PixelsByReferencePixels(const CameraModel& camera,
                                                       const SE3<Camera, World>& T_camera_world,
                                                       const SE3<World, Camera>& T_world_reference,
                                                       const Eigen::Vector3d& p_world);

// An image with a known pose, in which patches are searched.
struct PatchTarget {
  const CameraModel& camera;
  const RadialCorrection& lens;
  const HalvedImages& image;
  SE3<Camera, World> T_camera_world;
  Eigen::Vector3d center_world;
  const RollingShutter* shutter = nullptr;  // null: a global shutter
  bool is_converted = false;                // `image` was converted by `shutter`
};

// A point that was found by its patch.
struct FoundPatch {
  Eigen::Vector2d image_px = Eigen::Vector2d::Zero();  // see FrameFeatures
  double depth_mu = 0;                                 // z depth of the point
  double octave_scale = 1;
};

// Searches a point at its predicted pixel by its patch alone, where no descriptor confirms it: the images must agree
// well, and both cameras must view the point from similar directions. `T_world_reference`: of the patch's keyframe.
std::optional<FoundPatch> FindPatch(const ReferencePatch& patch, const SE3<World, Camera>& T_world_reference,
                                    const Eigen::Vector3d& p_world, const PatchTarget& target);

}  // namespace romap::slam
