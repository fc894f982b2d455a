#pragma once

#include <string>
#include <vector>

#include "client/files/tum.h"
#include "common/map_events.h"
#include "common/mapping_service.h"
#include "common/mesh.h"
#include "common/status.h"

namespace romap::cli {

// One object of a finished map with its mesh decoded and placed in the world.
struct MapObject {
  ObjectUpdate object;
  std::string file_stem;  // "<id>_<class>", safe as a file name
  Mesh mesh_world;        // empty when the object has no mesh
  double train_seconds = 0;
  uint64_t steps = 0;
};

// Decodes the meshes of confirmed objects, by id. An object whose mesh cannot be decoded keeps an empty one, and
// `faults` says why.
std::vector<MapObject> DecodeObjects(const std::vector<ObjectSnapshot>& objects, std::vector<std::string>* faults);

// The camera's way as a map has it now, in the order of its frames.
std::vector<files::StampedPose> TrajectoryOf(const MapSnapshot& snapshot);

// Writes objects/<id>_<class>.ply and .glb (World frame, map units) and cuboids.json below `dir`, which is made. Meshes
// of an earlier run in the same folder are removed.
absl::Status WriteMapFiles(const std::string& dir, const std::vector<MapObject>& objects);

}  // namespace romap::cli
