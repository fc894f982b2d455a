#include "server/mesh/refine_vertices.h"

#include <algorithm>
#include <array>
#include <vector>

namespace romap::mesh {
namespace {

constexpr int kSteps = 2;
// Larger values are clamped, because far from the surface they do not indicate where it is.
constexpr float kMaxVertexValue = 6.0f;

// The interval of a vertex's edge that contains the crossing, as shares of the whole edge.
struct Bracket {
  uint32_t vertex;
  int axis;
  float node_at_mu;  // coordinate of the edge's lower node along the axis
  std::array<float, 2> at = {0.0f, 1.0f};
  std::array<float, 2> value;
  int kept = -1;  // the end that the last step kept; -1 before the first

  // Position at which the line through both ends crosses 0.
  float Estimate() const {
    const float clear = kNodeClearance;
    const float share = at[0] + (at[1] - at[0]) * value[0] / (value[0] - value[1]);
    return std::clamp(share, clear, 1.0f - clear);
  }

  void Narrow(float estimate, float estimate_value) {
    const int moved = (estimate_value > 0) == (value[0] > 0) ? 0 : 1;
    at[moved] = estimate;
    value[moved] = std::clamp(estimate_value, -kMaxVertexValue, kMaxVertexValue);
    // The Illinois rule: halve the value of an end that was kept twice; otherwise the interval stops shrinking on that
    // side.
    if (kept == 1 - moved) value[kept] *= 0.5f;
    kept = 1 - moved;
  }
};

std::vector<Bracket> BracketsOf(const FieldGrid& grid, const GridSurface& surface) {
  const std::array<size_t, 3> stride = {1, grid.StrideY(), grid.StrideZ()};
  std::vector<Bracket> brackets;
  brackets.reserve(surface.grid_edges.size());
  for (size_t vertex = 0; vertex < surface.grid_edges.size(); ++vertex) {
    const int axis = static_cast<int>(surface.grid_edges[vertex] % 3);
    const size_t low = surface.grid_edges[vertex] / 3;
    const size_t high = low + stride[axis];
    if (grid.edited[low] != 0 || grid.edited[high] != 0) continue;
    if (grid.value[low] == kBeyondBox || grid.value[high] == kBeyondBox) continue;
    brackets.push_back({.vertex = static_cast<uint32_t>(vertex),
                        .axis = axis,
                        .node_at_mu = grid.Position(grid.NodeAt(low))[axis],
                        .value = {std::clamp(grid.value[low], -kMaxVertexValue, kMaxVertexValue),
                                  std::clamp(grid.value[high], -kMaxVertexValue, kMaxVertexValue)}});
  }
  return brackets;
}

}  // namespace

void RefineVertices(const FieldGrid& grid, const SurfaceProbe& probe, GridSurface& surface) {
  std::vector<Bracket> brackets = BracketsOf(grid, surface);
  std::vector<Eigen::Vector3f> points(brackets.size());
  std::vector<float> values(brackets.size());
  std::vector<float> estimates(brackets.size());
  for (int step = 0; step <= kSteps; ++step) {
    for (size_t i = 0; i < brackets.size(); ++i) {
      const Bracket& bracket = brackets[i];
      estimates[i] = bracket.Estimate();
      points[i] = surface.mesh.vertices[bracket.vertex];
      points[i][bracket.axis] = bracket.node_at_mu + estimates[i] * grid.spacing[bracket.axis];
    }
    if (step == kSteps) break;
    probe.Sample(points, values);
    for (size_t i = 0; i < brackets.size(); ++i) brackets[i].Narrow(estimates[i], values[i]);
  }
  for (size_t i = 0; i < brackets.size(); ++i) surface.mesh.vertices[brackets[i].vertex] = points[i];
}

}  // namespace romap::mesh
