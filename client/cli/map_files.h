#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/files/tum.h"
#include "common/map_events.h"
#include "common/mapping_service.h"
#include "common/mesh.h"
#include "common/status.h"

namespace romap::cli {

// One object of a map with its decoded mesh.
struct MapObject {
  ObjectUpdate object;
  std::string file_stem;  // "<id>_<class>", with only characters that are safe in file names
  Mesh mesh;              // in its own frame, near its origin; empty if the object has no mesh
  MeshTexture texture;    // of the mesh; may be empty
  Sim3<World, Object> S_world_mesh;
  double train_seconds = 0;  // of the mesh
  uint64_t steps = 0;        // training steps of the mesh
  std::optional<NextView> next_view = {};
};

// Decodes the meshes of all objects that are not provisional. If a mesh cannot be decoded, the object gets an empty
// mesh and a message is added to `faults`.
std::vector<MapObject> DecodeObjects(const std::vector<ObjectSnapshot>& objects, std::vector<std::string>* faults);

// The camera trajectory of a map, in order of frames.
std::vector<files::StampedPose> TrajectoryOf(const MapSnapshot& snapshot);

struct MapFileOptions {
  bool obj = false;                       // OBJ files with material and texture, too
  std::vector<std::string> formats = {};  // of other tools, see WriteExports()

  void AddTo(CLI::App& command);
};

// Writes objects/<id>_<class>.ply and .glb (World frame, map units) and cuboids.json in `dir`. Creates the folders and
// removes the meshes of an earlier run. Errors as WriteFile.
absl::Status WriteMapFiles(const std::string& dir, const std::vector<MapObject>& objects,
                           const MapFileOptions& options = {});

}  // namespace romap::cli
