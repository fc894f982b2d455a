#include "server/mesh/visible_base.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "common/mesh.h"
#include "server/mesh/marching_cubes.h"

namespace romap::mesh {
namespace {

// A surface observed at a flatter angle counts as invisible, because the walls around unobserved space are parallel to
// the flattest rays.
constexpr float kMinCosine = 0.2f;
// Share of the visible area that may lie below the base because of noise at the border of the hull.
constexpr double kShareBelow = 0.02;
// Walls have normals within 30 degrees of the horizontal. If the views observe almost no walls, for example from
// straight above, the lowest visible height is not the base.
constexpr float kMaxWallNormalZ = 0.5f;
constexpr double kMinWallShare = 0.05;  // of the visible area
// Slope of the values around the cut, per node spacing.
constexpr float kCutSlope = 4.0f;
// Only about this many triangles of a larger mesh are used.
constexpr size_t kEnoughTriangles = 6000;

// A round bottom: the lower half of the visible surface determines how its normals turn; those that point upward belong
// to something else. The turn must explain this share of their variance, and at the lowest visible height they must
// point clearly downward.
constexpr float kMaxRoundNormalZ = 0.3f;
constexpr double kMinTurnShare = 0.5;
constexpr double kRoundNormalZ = -0.35;
constexpr float kMaxBelow = 0.4f;  // of the visible height; 0.2 for a sphere that is seen from 35 degrees above

struct SurfacePatch {
  float height;    // z, map units
  float normal_z;  // of the unit normal
  double area;     // any unit
};

// The height below which `kShareBelow` of the area lies, from a histogram that is finer than the grid.
float LowHeight(const FieldGrid& grid, const std::vector<SurfacePatch>& patches, double total_area) {
  constexpr int kBinsPerNode = 16;
  const float bin_mu = grid.spacing.z() / kBinsPerNode;
  std::vector<double> area(static_cast<size_t>(kBinsPerNode * grid.nodes.z()), 0.0);
  for (const SurfacePatch& patch : patches) {
    const int bin = static_cast<int>((patch.height - grid.origin.z()) / bin_mu);
    area[static_cast<size_t>(std::clamp(bin, 0, static_cast<int>(area.size()) - 1))] += patch.area;
  }
  double below = 0;
  size_t bin = 0;
  while (bin + 1 < area.size() && (below += area[bin]) < kShareBelow * total_area) ++bin;
  return grid.origin.z() + (static_cast<float>(bin) + 0.5f) * bin_mu;
}

// Where a round bottom ends below the lowest visible height: a line through the z of the normals over the height
// reaches -1 there. `base_mu` if the bottom is not round.
float RoundBottom(const std::vector<SurfacePatch>& patches, float base_mu) {
  float top_mu = base_mu;
  for (const SurfacePatch& patch : patches) top_mu = std::max(top_mu, patch.height);
  double sum = 0, z = 0, n = 0, zz = 0, zn = 0, nn = 0;
  for (const SurfacePatch& patch : patches) {
    if (patch.height > 0.5f * (base_mu + top_mu) || patch.normal_z > kMaxRoundNormalZ) continue;
    const double height = patch.height - base_mu;
    sum += patch.area;
    z += patch.area * height;
    n += patch.area * patch.normal_z;
    zz += patch.area * height * height;
    zn += patch.area * height * patch.normal_z;
    nn += patch.area * patch.normal_z * patch.normal_z;
  }
  if (!(sum > 0)) return base_mu;
  const double z_variance = zz / sum - z / sum * (z / sum);
  const double n_variance = nn / sum - n / sum * (n / sum);
  const double covariance = zn / sum - z / sum * (n / sum);
  if (!(covariance > 0) || covariance * covariance < kMinTurnShare * z_variance * n_variance) return base_mu;
  const double slope = covariance / z_variance;
  const double normal_at_base = n / sum - slope * (z / sum);
  if (normal_at_base > kRoundNormalZ) return base_mu;
  const auto below_mu = static_cast<float>((1 + std::max(normal_at_base, -1.0)) / slope);
  return below_mu > kMaxBelow * (top_mu - base_mu) ? base_mu : base_mu - below_mu;
}

// Whether a vertex lies between two nodes with unedited field values.
bool IsFieldVertex(const FieldGrid& grid, const GridSurface& surface, uint32_t vertex) {
  const std::array<size_t, 3> stride = {1, grid.StrideY(), grid.StrideZ()};
  const size_t low = surface.grid_edges[vertex] / 3;
  return grid.edited[low] == 0 && grid.edited[low + stride[surface.grid_edges[vertex] % 3]] == 0;
}

}  // namespace

std::optional<float> FindVisibleBase(const FieldGrid& grid, VisibilityTester& visibility) {
  if (!visibility.has_views()) return std::nullopt;
  const GridSurface surface = MarchingCubes(grid);
  const Mesh& mesh = surface.mesh;
  std::vector<SurfacePatch> visible;
  double visible_area = 0;
  double wall_area = 0;
  const size_t stride = 1 + mesh.triangles.size() / kEnoughTriangles;
  for (size_t i = 0; i < mesh.triangles.size(); i += stride) {
    const auto& [a, b, c] = mesh.triangles[i];
    if (!IsFieldVertex(grid, surface, a) || !IsFieldVertex(grid, surface, b) || !IsFieldVertex(grid, surface, c))
      continue;
    const Eigen::Vector3f& p = mesh.vertices[a];
    const Eigen::Vector3f cross = (mesh.vertices[b] - p).cross(mesh.vertices[c] - p);
    const float area = cross.norm();
    if (!(area > 0)) continue;
    const Eigen::Vector3f normal = cross / area;
    const Eigen::Vector3f center = (p + mesh.vertices[b] + mesh.vertices[c]) / 3.0f;
    // The tested point is one node outside the surface, so that nodes inside the surface do not hide it.
    if (!visibility.IsSurfaceVisible(grid.ToNode(center) + normal, normal, kMinCosine)) continue;
    visible.push_back({center.z(), normal.z(), area});
    visible_area += area;
    if (std::abs(normal.z()) < kMaxWallNormalZ) wall_area += area;
  }
  if (visible.empty() || wall_area < kMinWallShare * visible_area) return std::nullopt;
  return RoundBottom(visible, LowHeight(grid, visible, visible_area));
}

void CutBelow(FieldGrid& grid, float height) {
  const float cut = (height - grid.origin.z()) / grid.spacing.z();  // in node coordinates
  const Eigen::Vector3i last = grid.nodes.array() - 2;
  for (int z = 1; z <= last.z(); ++z) {
    const float max_value = std::max(kCutSlope * (static_cast<float>(z) - cut), kEmpty);
    for (int y = 1; y <= last.y(); ++y) {
      for (size_t node = grid.Index(1, y, z), end = node + static_cast<size_t>(last.x()); node < end; ++node) {
        if (grid.value[node] > max_value) grid.Edit(node, max_value);
      }
    }
  }
}

}  // namespace romap::mesh
