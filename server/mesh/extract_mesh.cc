#include "server/mesh/extract_mesh.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "common/status.h"
#include "server/mesh/field_grid.h"
#include "server/mesh/floaters.h"
#include "server/mesh/hidden_space.h"
#include "server/mesh/marching_cubes.h"
#include "server/mesh/support_height.h"

namespace romap {
namespace {

absl::Status Validate(const FieldSnapshot& snapshot, const MeshConfig& config) {
  const std::string object = snapshot.object.ToString();
  if (!snapshot.field) return InvalidArgument("{}: the snapshot has no field", object);
  const Eigen::Vector3f& box = snapshot.box_half_extents;
  if (!box.allFinite() || !(box.minCoeff() > 0)) {
    return InvalidArgument("{}: box half extents {} {} {} must be finite and positive", object, box.x(), box.y(),
                           box.z());
  }
  if (!std::isfinite(snapshot.surface_level) || !std::isfinite(snapshot.connect_level)) {
    return InvalidArgument("{}: surface level {} and connect level {} must be finite", object, snapshot.surface_level,
                           snapshot.connect_level);
  }
  const size_t side = std::max(snapshot.hull.resolution, 0);
  if (snapshot.hull.bits.size() != side * side * side) {
    return InvalidArgument("{}: hull has {} bits, want {}^3", object, snapshot.hull.bits.size(), side);
  }
  if (config.resolution < 2) return InvalidArgument("mesh.resolution {} must be at least 2", config.resolution);
  return absl::OkStatus();
}

void ColorVertices(const FieldSampler& field, Mesh& mesh) {
  std::vector<float> raw(mesh.vertices.size());
  mesh.colors.resize(mesh.vertices.size());
  field.Sample(mesh.vertices, raw, mesh.colors);
}

}  // namespace

absl::StatusOr<Mesh> ExtractMesh(const FieldSnapshot& snapshot, const MeshConfig& config) {
  ROMAP_RETURN_IF_ERROR(Validate(snapshot, config));
  const float level = snapshot.surface_level;
  const float connect_level = std::min(snapshot.connect_level, level);

  FieldGrid grid = SampleField(snapshot, config.resolution);
  std::span<const Eigen::Vector3f> views;
  if (config.fill_unseen) views = snapshot.view_centers_object;
  FillHiddenSpace(grid, level, views, config.unseen_optical_depth);
  if (config.cut_below_support) {
    const auto height = FindSupportHeight(grid, level, snapshot.view_centers_object, config.unseen_optical_depth);
    if (height) CutBelow(grid, level, *height);
  }
  if (RemoveFloaters(grid, level, connect_level, config.min_component_share) == 0) {
    return FailedPrecondition("{}: no surface at this level", snapshot.object.ToString());
  }
  Mesh mesh = MarchingCubes(grid, level);
  ComputeVertexNormals(mesh);
  ColorVertices(*snapshot.field, mesh);
  return mesh;
}

}  // namespace romap
