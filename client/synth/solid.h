#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <string>
#include <vector>

#include "client/synth/material.h"
#include "common/mesh.h"

namespace romap::synth {

using Point = Eigen::Vector3f;  // meters

// A closed surface of one material. Every edge belongs to exactly two triangles.
struct SolidPart {
  Mesh mesh;  // positions and triangles only, in the frame of the solid; adjacent triangles share vertices
  Material material;
};

// The shape of an object: the union of its parts, which may overlap. Frame: z up, bottom at z = 0, bounding box of the
// footprint centered on the z axis.
struct Solid {
  std::string class_name;
  std::vector<SolidPart> parts;
};

// A closed polygon, counter-clockwise seen from the side of the next ring of a loft.
using Ring = std::vector<Point>;

// Connects rings with the same number of points to a closed surface; fans to `first_pole` and `last_pole` (usually
// inside the end rings) close the ends. Inserts rings where two are farther apart than `max_edge_m`, because light is
// stored per vertex.
Mesh Loft(const std::vector<Ring>& rings, const Point& first_pole, const Point& last_pole, float max_edge_m = 0.006F);

// The (radius, z) polyline of a surface of revolution around z, in meters.
using Profile = std::vector<Eigen::Vector2f>;

// Revolves a profile around the z axis. In the (radius, z) plane, the interior is to the left of the profile: bottom
// center, outward, up the outside and, for hollow shapes, down the inside. The ends are closed at the heights of the
// first and last points.
Mesh Revolve(const Profile& profile);

// A Catmull-Rom curve through the points, with `steps` segments between consecutive points.
Profile Smooth(const Profile& control, int steps = 6);
std::vector<Point> Smooth(const std::vector<Point>& control, int steps = 6);

// A tube along a path with elliptic cross-sections: `half_height_m[i]` in the direction that starts closest to `up`,
// and `half_width_m[i]` perpendicular to it. The ends are flat.
Mesh Sweep(const std::vector<Point>& path, std::span<const float> half_width_m, std::span<const float> half_height_m,
           const Point& up = Point::UnitZ());
// A tube with constant radius.
Mesh Tube(const std::vector<Point>& path, float radius_m);

Mesh Ellipsoid(const Point& center, const Point& half_axes);
// A box with rounded vertical edges and beveled horizontal edges.
Mesh RoundedBox(const Point& center, const Point& half_extents, float edge_radius_m, float max_edge_m = 0.006F);

// The mesh after rotation, then translation.
Mesh Moved(Mesh mesh, const Eigen::Quaternionf& rotation, const Point& translation);
// The rotation about an axis of any length.
Eigen::Quaternionf Turn(float angle_rad, const Point& axis);

// Translates the parts so that the solid is in the frame that Solid documents.
void Settle(Solid& solid);

// Axis-aligned bounds of all parts in the frame of the solid.
Eigen::AlignedBox3f Bounds(const Solid& solid);
// Radius around the z axis that contains the solid [m].
float FootprintRadius(const Solid& solid);

}  // namespace romap::synth
