#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "common/camera_model.h"
#include "server/objects/lines/line_segments.h"

namespace romap::objects {

// The straight edges of one object in one image. The position of the camera has no effect.
struct LineView {
  CameraModel camera;
  Eigen::Matrix3d R_world_camera;
  std::span<const LineSegment> segments;
};

struct LineYawOptions {
  double endpoint_noise_px = 0.7;  // standard deviation of a segment's ends, across it
  double tilt_rad = 0.02;          // standard deviation of `up` in a monocular map
  double spread_rad = 0.035;       // standard deviation of the directions of the edges of one object
  double vertical_rad = 0.14;      // a segment within this angle of the vertical in the image may be a vertical edge
  double half_edges = 5;           // number of edges of equal weight at which the confidence is half of its maximum
};

struct YawEstimate {
  double yaw_rad = 0;  // of the horizontal edges, relative to the reference's x axis, in [-pi/4, pi/4]
  // 0..1: the share of the edges that agree with this yaw minus the share that agrees with its best rival, reduced for
  // few edges. In our experiments it is above 0.25 only for box-like objects; round and irregular ones stay below 0.2
  // if they are observed from three or more directions.
  double confidence = 0;
  double share = 0;  // of the edges, by weight, that agree with this yaw
  int edges = 0;     // number of edges that voted
};

// Yaw of an upright cuboid from straight edges in several images at once.
//
// A segment and the camera center span a plane. A horizontal edge in this plane has one possible direction, at any
// depth: h = n x up, n the normal of the plane. Therefore each segment votes for one yaw (modulo a quarter turn,
// because the edges of a cuboid are at right angles), with an uncertainty that follows from its length and position.
// The votes of all images are summed with Tukey's biweight kernel; the maximum of the sampled curve is refined to the
// nearest stationary point. Vertical edges do not depend on yaw and are ignored.
//
// The confidence compares the result with two rivals: another yaw, and a solid of revolution. The outlines of the
// latter (circular edges that project to ellipses, slanted sides) move with the camera: their yaws are spread
// symmetrically around the view direction.
//
// This is the alignment of the paper's equations (2) and (3), with two changes: the angle at the camera center replaces
// the difference of slopes, which ignores perspective and the assignment of edges, and outliers are modeled.
//
// `R_world_reference`: z axis = up, x axis = yaw 0; of the equivalent yaws the one nearest to 0 is returned. nullopt
// when no segment determines a yaw. Takes about 0.3 us per segment.
std::optional<YawEstimate> YawFromLines(const Eigen::Matrix3d& R_world_reference, std::span<const LineView> views,
                                        const LineYawOptions& options = {});

}  // namespace romap::objects
