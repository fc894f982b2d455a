#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "common/camera_model.h"
#include "server/objects/lines/line_segments.h"

namespace romap::objects {

// The straight edges of one object in one image. Only where the camera looks matters, not where it stands.
struct LineView {
  CameraModel camera;
  Eigen::Matrix3d R_world_camera;
  std::span<const LineSegment> segments;
};

struct LineYawOptions {
  double endpoint_noise_px = 0.7;  // of a segment's ends, across it
  double tilt_rad = 0.02;          // by which `up` may be wrong: monocular maps have no better
  double spread_rad = 0.035;       // of the edges of one thing
  double vertical_rad = 0.14;      // so near to the vertical, in the image, a segment may be a vertical edge
  double few_edges = 5;            // so many edges of equal weight are worth half the confidence
};

struct YawEstimate {
  double yaw_rad = 0;  // of one of the horizontal edges, from the reference's x axis, in [-pi/4, pi/4]
  // 0..1: the share of the edges that this yaw explains, less the share that its best rival explains. 0.25 and more
  // were always box-like things; round and irregular ones stay below 0.2 once seen from three directions or more.
  double confidence = 0;
  double share = 0;  // of the edges, by weight, that this yaw explains
  int edges = 0;     // that had a say
};

// Yaw of an upright cuboid from straight edges in several images at once.
//
// A segment spans a plane with the camera's centre, and a horizontal edge that lies in it can have one direction only,
// whatever its depth: h = n x up, n the plane's normal. So each segment votes for one yaw (modulo a quarter turn, since
// the edges of a cuboid are at right angles), with an uncertainty that follows from its length and place. The votes are
// summed over all images with Tukey's biweight as kernel; the highest place of a sampled curve is refined to the
// nearest stationary point. Vertical edges tell nothing about yaw and are left out.
//
// Two rivals keep the answer honest: another yaw, and a thing of revolution, whose outlines (rims seen as ellipses,
// slanted sides) follow the camera: their yaws are spread evenly, on either side alike, around the direction of view.
//
// This is the alignment of the paper's equations (2) and (3) with the angle at the camera's centre in place of the
// difference of slopes, which knows neither perspective nor which edge is meant, and with outliers accounted for.
//
// `R_world_reference`: z axis = up, x axis = yaw 0; the edge nearest to it is named. nullopt when no segment tells
// anything. Costs about 0.3 us for each segment.
std::optional<YawEstimate> YawFromLines(const Eigen::Matrix3d& R_world_reference, std::span<const LineView> views,
                                        const LineYawOptions& options = {});

}  // namespace romap::objects
