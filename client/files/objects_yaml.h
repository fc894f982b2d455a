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
  int64_t id = 0;  // in a sequence's objects.yaml also the object's label in the masks
  std::string name;
  std::string class_name;
  SE3<World, Object> T_world_object;
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  // map units, along the Object axes
  std::optional<double> confidence;                        // 0..1; of estimated cuboids
};

struct ObjectsYaml {
  Eigen::Vector3d up_world = Eigen::Vector3d::UnitZ();  // unit length
  std::vector<ObjectRecord> objects;
};

// Reads cuboids from .yaml/.yml or .json: `world_up: [x, y, z]` (optional, default z) and `objects:` with id, name,
// class, half_extents and either T_world_object (row-major 4x4) or center and yaw [rad about z]. NOT_FOUND or
// INVALID_ARGUMENT naming file, object and fault: rotation not orthonormal, half extents not positive, something not a
// finite number.
absl::StatusOr<ObjectsYaml> ReadObjects(const std::string& path);

// Writes the same as YAML (the layout of a sequence's objects.yaml) or, where the path ends in .json, as JSON.
absl::Status WriteObjects(const std::string& path, const ObjectsYaml& objects);

}  // namespace romap::files
