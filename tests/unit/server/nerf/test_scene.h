#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/cuboid.h"
#include "common/field_snapshot.h"
#include "common/stage_messages.h"
#include "server/nerf/nerf_config.h"

namespace romap::testing_support {

// A striped ball of radius `radius_mu` seen by a ring of cameras, rendered exactly.
struct BallScene {
  double radius_mu = 0.5;
  int views = 12;
  int size_px = 72;
  Eigen::Vector3d center_world{0.3, -0.2, 0.1};  // times radius_mu / 0.5, so that the scene scales as a whole
  bool with_depth = false;

  ObjectId object{7};
  Eigen::Vector3d Center() const { return center_world * (radius_mu / 0.5); }
  Cuboid Box() const;
  ObjectView View(int index) const;
  std::vector<ObjectView> Views() const;
};

// Configuration of a small field that learns the ball quickly.
nerf::NerfConfig SmallFieldConfig();

// The mean distance, in radii, of the learned surface from the ball, over evenly distributed directions. The surface is
// where raw first exceeds the surface level on a line from outside to the center, inside the hull. A direction without
// surface counts as 1.
double BallSurfaceError(const BallScene& scene, const FieldSnapshot& snapshot);

// Raw values on a regular grid of 1000 points, from -reach to +reach of the box.
std::vector<float> RawOnGrid(const FieldSnapshot& snapshot, float reach = 1);

}  // namespace romap::testing_support
