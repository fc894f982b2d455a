#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "common/stage_messages.h"

namespace romap::nerf {

// A small rigid motion of an object relative to a camera: p moves to center + R(turn) (p - center) + shift, in the
// Camera frame, where `center` is the center of the object. Elements: turn (rotation vector, rad), then shift (map
// units).
using ObjectMotion = Eigen::Matrix<double, 6, 1>;

// `T_camera_object` after `motion` of the object, whose center is the origin of the Object frame.
SE3<Camera, Object> Moved(const SE3<Camera, Object>& T_camera_object, const ObjectMotion& motion);
// The motion for which Moved(T_from, motion) is T_to.
ObjectMotion MotionBetween(const SE3<Camera, Object>& T_from, const SE3<Camera, Object>& T_to);

// A rendering of the field at one pixel of a view.
struct RenderedPixel {
  int u_px = 0, v_px = 0;                                 // in the full image
  Eigen::Vector3d p_camera_mu = Eigen::Vector3d::Zero();  // surface point; at the object's depth if transparent
  std::array<float, 3> bgr = {};                          // 0..1
  float opacity = 0;                                      // 0..1
};

// Aligns one view with renderings of the field. Shares the image data of the view.
class ViewAlignment {
 public:
  explicit ViewAlignment(const ObjectView& view);

  // Up to `count` pixels, in the full image, evenly spaced over the object, and up to `count` over both sides of its
  // outline. `salt` varies the choice.
  std::vector<cv::Point> Pixels(size_t count, uint64_t salt) const;

  // The motion of the object that makes the view match the rendering: its colors, up to an offset per channel, and its
  // outline. Least squares by Gauss-Newton on the gradients of the view (B. Lucas, T. Kanade, "An Iterative Image
  // Registration Technique", 1981). The prior on the camera error is a shift of the object by `prior_px` (standard
  // deviation) in each direction, and a rotation of the camera that causes the same shift. `applied` is the motion
  // already applied. Zero if there is no improvement or there are too few pixels.
  ObjectMotion Align(std::span<const RenderedPixel> rendered, const SE3<Camera, Object>& T_camera_object,
                     const ObjectMotion& applied, double prior_px) const;

 private:
  struct Scales;
  struct Equations;
  struct Projection;
  Equations Linearize(std::span<const RenderedPixel> rendered, const Eigen::Vector3d& center,
                      const ObjectMotion& motion, const Scales& scales) const;
  void AddOutline(const RenderedPixel& pixel, const Projection& projection, const Scales& scales,
                  Equations& equations) const;
  void AddColor(const RenderedPixel& pixel, const Projection& projection, const Scales& scales,
                Equations& equations) const;

  CameraModel camera_;
  cv::Rect roi_px_;
  cv::Mat bgr_, smooth_bgr_;  // CV_8UC3; smoothed
  cv::Mat object_;            // CV_8UC1, 255 = object
  cv::Mat ramp_;              // CV_8UC1, share of the neighborhood that is object, 255 = all
  cv::Mat near_occluder_;     // CV_8UC1, not 0 near an occluder
};

}  // namespace romap::nerf
