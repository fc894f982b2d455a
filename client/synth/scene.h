#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "client/render/rasterizer.h"
#include "client/synth/material.h"
#include "client/synth/solid.h"
#include "common/geometry.h"

namespace romap::synth {

// World frame: metres, z up, the floor at z = 0, the table's middle above the origin.

// One object on the table.
struct SceneObject {
  uint8_t label = 0;  // in masks and objects.yaml, 1..
  std::string name;   // unique, e.g. "mug_2"
  Solid solid;        // in its own frame
  SE3<World, Object> T_world_solid;
  // Tight cuboid; its yaw is the solid's.
  SE3<World, Object> T_world_object;
  Eigen::Vector3d half_extents_m = Eigen::Vector3d::Zero();
};

// A part of an object or of the room.
struct SceneSurface {
  Material material;
  uint8_t label = 0;  // of its object, 0 = room
};

// Rectangle that shines to both sides.
struct AreaLight {
  Eigen::Vector3f center_m, half_u_m, half_v_m;
  Rgb power = Rgb::Ones();  // irradiance it gives at 1 m in front of it, facing it
};

struct SceneOptions {
  uint64_t seed = 1;
  int objects = 6;
  int identical_pairs = 0;
  double min_room_half_m = 2;  // the room grows with what is on the table, and is no smaller than this
  bool plain_wall = false;     // the wall at +y shows next to nothing a camera could hold on to
};

struct Scene {
  std::vector<SceneObject> objects;
  double table_height_m = 0;
  double layout_radius_m = 0;  // circle around the origin that holds all objects
  double room_half_m = 0;      // the room spans -half..half in x and y
  std::vector<AreaLight> lights;

  // Everything there is to draw. Per vertex:
  std::vector<Eigen::Vector3f> positions_world;  // metres
  std::vector<Eigen::Vector3f> positions_local;  // metres, in the frame of the part's material
  std::vector<Eigen::Vector3f> normals_world;    // unit length
  std::vector<Rgb> irradiance;                   // see lighting.h
  // Per triangle:
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<uint16_t> surface_of_triangle;
  std::vector<SceneSurface> surfaces;

  render::TriangleSoup Soup() const { return {positions_world, triangles}; }
};

// Adds a mesh of one material to what is drawn. Vertices are shared by triangles that meet at less than 40 degrees and
// doubled where the surface has an edge.
void AddSurface(Scene& scene, const Mesh& mesh_local, const SE3<World, Object>& T_world_local, const Material& material,
                uint8_t label);

// A room with a table, and objects on it that keep a distance from each other. The first 2 * identical_pairs objects
// are pairs of twins. Everything follows from the seed. Irradiance is left empty.
Scene MakeScene(const SceneOptions& options);

// room.cc: fills in room_half_m and lights and adds the surfaces of floor, walls, furniture and table.
void AddRoom(Scene& scene, const SceneOptions& options, Random& random);

}  // namespace romap::synth
