#include "server/mesh/extract_mesh.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/status.h"
#include "common/thread_time.h"
#include "server/mesh/confidence.h"
#include "server/mesh/filtered_normals.h"
#include "server/mesh/floaters.h"
#include "server/mesh/grid_resolution.h"
#include "server/mesh/hidden_space.h"
#include "server/mesh/marching_cubes.h"
#include "server/mesh/refine_vertices.h"
#include "server/mesh/sample_field.h"
#include "server/mesh/solid_cut.h"
#include "server/mesh/surface_probe.h"
#include "server/mesh/vertex_normals.h"
#include "server/mesh/visibility.h"
#include "server/mesh/visible_base.h"

namespace romap::mesh {
namespace {

constexpr float kMaxOpticalDepth = 0.2f;  // toward a view; a point with a larger one is invisible

absl::Status Validate(const FieldSnapshot& snapshot, const MeshConfig& config) {
  const std::string object = snapshot.object.ToString();
  if (!snapshot.field) return InvalidArgument("{}: the snapshot has no field", object);
  const Eigen::Vector3f& box = snapshot.box_half_extents;
  if (!box.allFinite() || !(box.minCoeff() > 0)) {
    return InvalidArgument("{}: box half extents {} {} {} must be finite and positive", object, box.x(), box.y(),
                           box.z());
  }
  if (!std::isfinite(snapshot.surface_level) || !std::isfinite(snapshot.connect_level)) {
    return InvalidArgument("{}: surface_level {} and connect_level {} must be finite", object, snapshot.surface_level,
                           snapshot.connect_level);
  }
  const auto& [density, per_efold] = snapshot.optics;
  if (!std::isfinite(density) || !std::isfinite(per_efold) || !(density > 0) || !(per_efold > 0)) {
    return InvalidArgument("{}: surface density {} and raw_per_efold {} must be finite and positive", object, density,
                           per_efold);
  }
  const size_t side = std::max(snapshot.hull.resolution, 0);
  if (snapshot.hull.bits.size() != side * side * side) {
    return InvalidArgument("{}: hull has {} cells, must have {}^3", object, snapshot.hull.bits.size(), side);
  }
  if (config.resolution < 2) return InvalidArgument("mesh.resolution must be at least 2, got {}", config.resolution);
  return absl::OkStatus();
}

// Measures the CPU time of the thread in consecutive phases.
class PhaseClock {
 public:
  explicit PhaseClock(MeshStats& stats) : stats_(stats), last_s_(ThreadCpuSeconds()) {}
  void EndPhase() {
    const double now_s = ThreadCpuSeconds();
    stats_.phase_cpu_s[phase_++] += now_s - last_s_;
    last_s_ = now_s;
  }

 private:
  MeshStats& stats_;
  double last_s_;
  size_t phase_ = 0;
};

VisibilityLimits LimitsOf(const FieldSnapshot& snapshot) {
  VisibilityLimits limits{.view_centers = {},
                          .surface_density_per_mu = snapshot.optics.surface_density_per_mu,
                          .max_optical_depth = kMaxOpticalDepth};
  for (const TrainingCamera& view : snapshot.cameras) {
    limits.view_centers.push_back(view.T_camera_object.Inverse().translation().cast<float>());
  }
  return limits;
}

void ColorVertices(const SurfaceProbe& probe, Mesh& mesh) {
  std::vector<float> values(mesh.vertices.size());
  mesh.colors.resize(mesh.vertices.size());
  probe.Sample(mesh.vertices, values, mesh.colors);
}

}  // namespace

absl::StatusOr<Mesh> ExtractMesh(const FieldSnapshot& snapshot, const MeshConfig& config, MeshStats* stats) {
  ROMAP_RETURN_IF_ERROR(Validate(snapshot, config));
  MeshStats own_stats;
  PhaseClock clock(stats != nullptr ? *stats : own_stats);
  const SurfaceProbe probe(snapshot);
  const Eigen::Vector3i nodes = ChooseNodes(snapshot, config);
  auto [grid, samples] = SampleField(snapshot, probe, nodes);
  clock.EndPhase();

  VisibilityTester visibility(grid, LimitsOf(snapshot));
  VisibilityTester no_views(grid, {});
  // The cut takes several times as long as the rest, so meshes of fields that still train do without it.
  if (!config.fill_unseen || !snapshot.converged || !CutSolid(grid, snapshot)) {
    FillHiddenSpace(grid, config.fill_unseen ? visibility : no_views);
  }
  clock.EndPhase();
  if (config.cut_below_support) {
    const std::optional<float> base = FindVisibleBase(grid, visibility);
    if (base) CutBelow(grid, *base);
  }
  clock.EndPhase();
  if (RemoveFloaters(grid, probe.connect_value(), config.min_component_share) == 0) {
    return FailedPrecondition("{}: the field is nowhere above the surface level", snapshot.object.ToString());
  }
  clock.EndPhase();

  GridSurface surface = MarchingCubes(grid);
  clock.EndPhase();
  RefineVertices(grid, probe, surface);
  clock.EndPhase();
  Mesh mesh = std::move(surface.mesh);
  if (snapshot.converged) {
    SetFilteredNormals(mesh);
  } else {
    SetVertexNormals(mesh);
  }
  clock.EndPhase();
  ColorVertices(probe, mesh);
  clock.EndPhase();
  SetConfidence(snapshot.cameras, snapshot.box_half_extents, grid.spacing.maxCoeff(), mesh);
  if (config.trim_unseen) TrimUnseen(static_cast<float>(config.trim_confidence), mesh);
  clock.EndPhase();
  if (stats != nullptr) {
    stats->nodes = nodes;
    stats->sampled_nodes = samples;
  }
  if (mesh.triangles.empty()) return FailedPrecondition("{}: no view observed the surface", snapshot.object.ToString());
  return mesh;
}

}  // namespace romap::mesh
