#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/geometry.h"
#include "common/status.h"

namespace romap::files {

// One cuboid of objects.yaml or cuboids.json.
struct ObjectRecord {
  int64_t id = 0;  // in objects.yaml of a sequence also the label in the masks
  std::string name;
  std::string class_name;
  SE3<World, Object> T_world_object;
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  // map units, along the axes of Object
  std::optional<double> confidence;                        // 0..1; estimated cuboids only
};

struct ObjectsYaml {
  Eigen::Vector3d up_world = Eigen::Vector3d::UnitZ();  // unit length
  std::vector<ObjectRecord> objects;
};

// Reads cuboids from a YAML or JSON file: `world_up: [x, y, z]` (optional, default z) and `objects:`, a list of id,
// name, class, half_extents and either T_world_object (row-major 4x4) or center and yaw [rad about z]. INVALID_ARGUMENT
// names the file, the object and the error: rotation not orthonormal, half extents not positive, or a value that is
// not a finite number. Otherwise as ReadFile.
absl::StatusOr<ObjectsYaml> ReadObjects(const std::string& path);

// Writes the same format, as JSON if the path ends in .json, otherwise as YAML. Errors as WriteFile.
absl::Status WriteObjects(const std::string& path, const ObjectsYaml& objects);

}  // namespace romap::files
