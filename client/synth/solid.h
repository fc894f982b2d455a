#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <string>
#include <vector>

#include "client/synth/material.h"
#include "common/mesh.h"

namespace romap::synth {

using Point = Eigen::Vector3f;  // metres

// A closed surface of one material. Every edge belongs to exactly two triangles.
struct SolidPart {
  Mesh mesh;  // vertices only, in the solid's frame; shared by neighbouring triangles
  Material material;
};

// A thing that stands on a table: the union of its parts, which may reach into each other. Frame: z up, standing on
// z = 0, footprint's bounding box centred on the z axis.
struct Solid {
  std::string class_name;
  std::vector<SolidPart> parts;
};

// A closed curve of points, counter-clockwise seen from where the loft goes to.
using Ring = std::vector<Point>;

// Skin over rings of equal point counts, closed at both ends by a fan to `first_pole` and `last_pole` (normally inside
// the end rings). Rings farther apart than `max_edge_m` get rings between them, so that light can vary over the skin.
Mesh Loft(const std::vector<Ring>& rings, const Point& first_pole, const Point& last_pole, float max_edge_m = 0.006F);

// (radius, z) along the meridian of a surface of revolution around z, in metres.
using Profile = std::vector<Eigen::Vector2f>;

// Turns a profile around the z axis. It runs from one pole to the other with what it encloses on its left seen in the
// (radius, z) plane: bottom centre, out, up the outside, and (for a hollow thing) down the inside. End points of radius
// 0 are implied: the ends are closed at the height of the first and last point.
Mesh Revolve(const Profile& profile);

// A Catmull-Rom curve through the points with `steps` pieces between neighbours.
Profile Smooth(const Profile& control, int steps = 6);
std::vector<Point> Smooth(const std::vector<Point>& control, int steps = 6);

// A tube along a path; at path[i] its cross-section is an ellipse of half width `half_width_m[i]` across and
// `half_height_m[i]` along the side that starts nearest to `up`. Ends are flat.
Mesh Sweep(const std::vector<Point>& path, std::span<const float> half_width_m, std::span<const float> half_height_m,
           const Point& up = Point::UnitZ());
// The same with one radius everywhere.
Mesh Tube(const std::vector<Point>& path, float radius_m);

Mesh Ellipsoid(const Point& center, const Point& half_axes);
// A box with rounded vertical edges and bevelled rims, centred on `center`.
Mesh RoundedBox(const Point& center, const Point& half_extents, float edge_radius_m, float max_edge_m = 0.006F);

// The mesh turned, then moved.
Mesh Moved(Mesh mesh, const Eigen::Quaternionf& rotation, const Point& translation);
Eigen::Quaternionf Turn(float angle_rad, const Point& axis);

// Moves the parts into the frame Solid promises.
void Settle(Solid& solid);

// Axis-aligned bounds of all parts in the solid's frame.
Eigen::AlignedBox3f Bounds(const Solid& solid);
// Radius around the z axis that holds all of it, metres.
float FootprintRadius(const Solid& solid);

}  // namespace romap::synth
