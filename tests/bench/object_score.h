#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "client/eval/alignment.h"
#include "client/files/objects_yaml.h"
#include "common/map_events.h"

namespace romap::measure {

// The errors of one mapped object.
struct ObjectErrors {
  double iou = 0;          // of the upright boxes
  double center_cm = 0;    // distance of the centers
  double in_plane_cm = 0;  // its horizontal part
  double yaw_deg = 0;      // modulo 90 degrees, 0..45: a cuboid has no front
  bool right_class = false;
};

// A true object and the errors of the mapped object that it was matched with.
struct TrueObject {
  std::string name;
  bool found = false;
  ObjectErrors errors;  // if found
};

// An object of the map.
struct MappedObject {
  ObjectUpdate object;
  Eigen::Vector3d center_m = Eigen::Vector3d::Zero();  // in the true world
  std::string matched;                                 // name of the true object it was matched with; empty = extra
  std::string overlaps;  // if extra: name of the found true object that it shares the most volume with; or empty
};

struct MapScore {
  std::vector<TrueObject> objects;   // in the order of the truth
  std::vector<MappedObject> mapped;  // in the order of the map

  size_t Found() const;
  size_t Extra() const;
};

// Matches the objects of a map one to one with the true ones so that the sum of the distances of their centers is
// smallest. A match requires that the boxes overlap and that the centers are no farther apart than half the diagonal of
// the true box; other true objects are missing, and other mapped ones are extra. `S_true_map` maps the world of the map
// to the true world, in meters.
MapScore ScoreMap(const files::ObjectsYaml& truth, std::span<const ObjectUpdate> objects,
                  const Sim3<World, World>& S_true_map);

}  // namespace romap::measure
