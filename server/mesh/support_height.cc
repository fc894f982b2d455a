#include "server/mesh/support_height.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "common/mesh.h"
#include "server/mesh/marching_cubes.h"
#include "server/mesh/sight_tester.h"

namespace romap {
namespace {

// The walls of hidden space below an object run along the flattest lines of sight, so that a view may graze them; a
// surface counts as seen only by views within 60 degrees of its normal.
constexpr float kMinCosine = 0.5f;
// Of the visible area; what is noise at the rim of the hull.
constexpr double kShareBelow = 0.02;
// Walls have normals within 30 degrees of the horizontal. Where views see hardly any, as from straight above, the
// lowest visible height says nothing.
constexpr float kMaxWallNormalZ = 0.5f;
constexpr double kMinWallShare = 0.05;  // of the visible area
// Raw units per node spacing with which matter fades below the cut.
constexpr float kCutSlope = 4.0f;

struct SurfacePatch {
  float height;  // z, map units
  double area;   // any unit
};

}  // namespace

std::optional<float> FindSupportHeight(const FieldGrid& grid, float level,
                                       std::span<const Eigen::Vector3f> view_centers, double max_optical_depth) {
  SightTester sight(grid, level, view_centers, static_cast<float>(max_optical_depth));
  const Mesh mesh = MarchingCubes(grid, level);
  std::vector<SurfacePatch> visible;
  double visible_area = 0;
  double wall_area = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3f& p = mesh.vertices[a];
    const Eigen::Vector3f cross = (mesh.vertices[b] - p).cross(mesh.vertices[c] - p);
    const float area = cross.norm();
    if (!(area > 0)) continue;
    const Eigen::Vector3f normal = cross / area;
    const Eigen::Vector3f center = (p + mesh.vertices[b] + mesh.vertices[c]) / 3.0f;
    // One node out, so that the nodes that make the surface do not hide it.
    if (!sight.IsSurfaceSeen(grid.ToNode(center) + normal, normal, kMinCosine)) continue;
    visible.push_back({center.z(), area});
    visible_area += area;
    if (std::abs(normal.z()) < kMaxWallNormalZ) wall_area += area;
  }
  if (visible.empty() || wall_area < kMinWallShare * visible_area) return std::nullopt;
  std::sort(visible.begin(), visible.end(),
            [](const SurfacePatch& a, const SurfacePatch& b) { return a.height < b.height; });
  double below = 0;
  for (const SurfacePatch& patch : visible) {
    below += patch.area;
    if (below >= kShareBelow * visible_area) return patch.height;
  }
  return visible.back().height;
}

void CutBelow(FieldGrid& grid, float level, float height) {
  const float cut = (height - grid.origin.z()) / grid.spacing.z();  // in node coordinates
  const int last = grid.nodes_per_side - 2;
  for (int z = 1; z <= last; ++z) {
    const float most = level + kCutSlope * (static_cast<float>(z) - cut);
    for (int y = 1; y <= last; ++y) {
      float* row = &grid.raw[grid.Index(0, y, z)];
      for (int x = 1; x <= last; ++x) row[x] = std::min(row[x], std::max(most, kEmptyRaw));
    }
  }
}

}  // namespace romap
