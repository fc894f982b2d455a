#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "common/stage_messages.h"

namespace romap::nerf {

// A small rigid motion of an object before a camera: p goes to center + R(turn) (p - center) + shift, all in the Camera
// frame, with the object's centre. The six are turn (rotation vector, rad) and shift (map units).
using ObjectMotion = Eigen::Matrix<double, 6, 1>;

// `T_camera_object` after the object underwent `motion`; the origin of the Object frame is its centre.
SE3<Camera, Object> Moved(const SE3<Camera, Object>& T_camera_object, const ObjectMotion& motion);
// The motion for which Moved(T_from, motion) is T_to.
ObjectMotion MotionBetween(const SE3<Camera, Object>& T_from, const SE3<Camera, Object>& T_to);

// What a field shows in one pixel of a view.
struct RenderedPixel {
  int u_px = 0, v_px = 0;                                 // in the full image
  Eigen::Vector3d p_camera_mu = Eigen::Vector3d::Zero();  // what is seen there; where nothing is, as deep as the object
  std::array<float, 3> bgr = {};                          // 0..1
  float opacity = 0;                                      // 0..1
};

// A view's picture and mask, ready to be compared with renderings of a field. Keeps a reference to the view's images.
class ViewAlignment {
 public:
  explicit ViewAlignment(const ObjectView& view);

  // Up to `most` pixels, in the full image, spread over the object, and as many spread over both sides of its outline.
  // Another `salt` chooses others.
  std::vector<cv::Point> Pixels(size_t most, uint64_t salt) const;

  // The motion of the object after which the view would show what was rendered: the colours, up to an offset per
  // channel, and the outline. Least squares by Gauss-Newton on the view's own gradients (B. Lucas, T. Kanade, "An
  // Iterative Image Registration Technique", 1981). Cameras are taken to be off by `prior_px` (standard deviation) in
  // each direction and by what turns them so far; `so_far` is how much of that was made up for before. Zero when
  // nothing better was found or too little is seen.
  ObjectMotion Align(std::span<const RenderedPixel> rendered, const SE3<Camera, Object>& T_camera_object,
                     const ObjectMotion& so_far, double prior_px) const;

 private:
  struct Scales;
  struct Equations;
  struct Place;
  Equations Linearize(std::span<const RenderedPixel> rendered, const Eigen::Vector3d& center,
                      const ObjectMotion& motion, const Scales& scales) const;
  void AddOutline(const RenderedPixel& pixel, const Place& place, const Scales& scales, Equations& equations) const;
  void AddColor(const RenderedPixel& pixel, const Place& place, const Scales& scales, Equations& equations) const;

  CameraModel camera_;
  cv::Rect roi_px_;
  cv::Mat bgr_, smooth_bgr_;  // CV_8UC3
  cv::Mat object_;            // CV_8UC1, 255 = object
  cv::Mat ramp_;              // CV_8UC1, how much of the surroundings is object, 255 = all
  cv::Mat doubtful_;          // CV_8UC1, not 0 where an occluder is near
};

}  // namespace romap::nerf
