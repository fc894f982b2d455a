#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "client/render/rasterizer.h"
#include "client/synth/material.h"
#include "client/synth/options.h"
#include "client/synth/solid.h"
#include "common/geometry.h"

namespace romap::synth {

// World frame of the scene: meters, z up, floor at z = 0, center of the table above the origin.

// One object on the table.
struct SceneObject {
  uint8_t label = 0;  // in masks and objects.yaml, from 1
  std::string name;   // unique, e.g. "mug_2"
  Solid solid;        // in the frame of the solid
  SE3<World, Object> T_world_solid;
  // The tight cuboid, with the yaw of the solid.
  SE3<World, Object> T_world_object;
  Eigen::Vector3d half_extents_m = Eigen::Vector3d::Zero();
};

// The surface of a part of an object or of the room.
struct SceneSurface {
  Material material;
  uint8_t label = 0;  // of the object, 0 = room
};

// A rectangular light that emits on both sides.
struct AreaLight {
  Eigen::Vector3f center_m, half_u_m, half_v_m;
  Rgb power = Rgb::Ones();  // irradiance on a surface that faces it at a distance of 1 m
};

struct SceneOptions {
  uint64_t seed = 1;
  int objects = 6;
  int identical_pairs = 0;
  double min_room_half_m = 2;  // minimal half side of the room, which grows with the objects on the table
  bool plain_wall = false;     // makes the wall at +y almost textureless; distinct walls only
  Surroundings surroundings = {};
};

struct Scene {
  std::vector<SceneObject> objects;
  double table_height_m = 0;
  double layout_radius_m = 0;  // radius around the z axis that contains all objects
  double room_half_m = 0;      // the room spans -half..half in x and y
  std::vector<AreaLight> lights;
  Rgb background = Rgb::Zero();  // of pixels that show no triangle

  // The triangles to render. Per vertex:
  std::vector<Eigen::Vector3f> positions_world;  // meters
  std::vector<Eigen::Vector3f> positions_local;  // meters, in the frame of the material
  std::vector<Eigen::Vector3f> normals_world;    // unit length
  std::vector<Rgb> irradiance;                   // see lighting.h
  // Per triangle:
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<uint16_t> surface_of_triangle;
  std::vector<SceneSurface> surfaces;

  render::TriangleSoup Soup() const { return {positions_world, triangles}; }
};

// Adds a mesh of one material to the scene. Triangles share vertices, and thus normals, where they meet at less than 40
// degrees; at sharper edges vertices are duplicated.
void AddSurface(Scene& scene, const Mesh& mesh_local, const SE3<World, Object>& T_world_local, const Material& material,
                uint8_t label);

// Makes a room with a table and objects on it that do not touch. The first 2 * identical_pairs objects are pairs of
// identical objects. The seed determines everything. Leaves Scene::irradiance empty.
Scene MakeScene(const SceneOptions& options);

// Sets room_half_m, lights and background, and adds the surfaces of floor, walls, furniture and table, except those
// that `options.surroundings` removes. Defined in room.cc.
void AddRoom(Scene& scene, const SceneOptions& options, Random& random);

}  // namespace romap::synth
