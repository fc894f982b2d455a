#pragma once

#include <string>
#include <vector>

#include "common/geometry.h"
#include "common/mesh.h"
#include "common/status.h"

namespace romap::exports {

struct UsdObject {
  std::string name;        // becomes the name of the prim
  std::string class_name;  // kept as custom data
  const Mesh* mesh = nullptr;
  const MeshTexture* texture = nullptr;  // may be empty
  Sim3<World, Object> S_world_mesh;
};

// Writes the meshes as one stage in the text form of USD (openusd.org, "USDA"), z up, one map unit = one meter, and
// their textures beside it, as NAME.jpg or NAME.png. Objects without triangles are left out. Errors as WriteFile.
absl::Status WriteUsd(const std::string& path, const std::vector<UsdObject>& objects);

}  // namespace romap::exports
