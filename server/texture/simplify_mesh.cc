#include "server/texture/simplify_mesh.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "server/texture/manifold.h"
#include "server/texture/mesh_edges.h"

namespace romap::texture {
namespace {

// An error that no collapse reaches, relative to the extent of the mesh.
constexpr float kAnyError = 1e3f;
// Runs of meshoptimizer, while each leaves at most this share of the triangles.
constexpr int kMostRuns = 6;
constexpr float kWorthwhile = 0.95f;
// A closed surface has at least as many.
constexpr size_t kFewestTriangles = 4;
constexpr size_t kMaxLevels = 2;
constexpr size_t kLevelFactor = 4;
constexpr size_t kFewestLevelTriangles = 200;
constexpr float kMostOfLevel = 0.6f;

struct Collapsed {
  std::vector<std::array<uint32_t, 3>> triangles;
  float error_mu = 0;
};

Collapsed CollapseOnce(std::span<const Eigen::Vector3f> vertices, std::span<const std::array<uint32_t, 3>> triangles,
                       size_t fewest_triangles, float max_error_mu, float scale_mu) {
  Collapsed result;
  result.triangles.resize(triangles.size());
  const float max_error = std::min(max_error_mu / scale_mu, kAnyError);
  const size_t indices = meshopt_simplify(
      result.triangles.data()->data(), triangles.data()->data(), triangles.size() * 3, vertices.data()->data(),
      vertices.size(), sizeof(Eigen::Vector3f), fewest_triangles * 3, max_error, 0, &result.error_mu);
  result.triangles.resize(indices / 3);
  result.error_mu *= scale_mu;
  return result;
}

// Repeated, because meshoptimizer stops early on flat regions, where most of the candidates would reverse a triangle.
Collapsed Collapse(const Mesh& mesh, size_t fewest_triangles, float max_error_mu, float scale_mu) {
  Collapsed result = CollapseOnce(mesh.vertices, mesh.triangles, fewest_triangles, max_error_mu, scale_mu);
  for (int run = 1; run < kMostRuns && result.triangles.size() > fewest_triangles; ++run) {
    const size_t before = result.triangles.size();
    Collapsed next =
        CollapseOnce(mesh.vertices, result.triangles, fewest_triangles, max_error_mu - result.error_mu, scale_mu);
    next.error_mu += result.error_mu;
    result = std::move(next);
    if (static_cast<float>(result.triangles.size()) > kWorthwhile * static_cast<float>(before)) break;
  }
  return result;
}

Mesh WithTriangles(const Mesh& mesh, ManifoldTriangles&& manifold) {
  Mesh result;
  const auto copy = [&](const auto& from, auto& to) {
    if (from.empty()) return;
    to.reserve(manifold.source.size());
    for (const uint32_t source : manifold.source) to.push_back(from[source]);
  };
  copy(mesh.vertices, result.vertices);
  copy(mesh.colors, result.colors);
  copy(mesh.confidence, result.confidence);
  copy(mesh.normals, result.normals);
  copy(mesh.uv, result.uv);
  result.triangles = std::move(manifold.triangles);
  if (result.normals.empty()) SetAngleWeightedNormals(result);
  return result;
}

}  // namespace

Simplified SimplifyMesh(const Mesh& mesh, const SimplifyOptions& options) {
  Simplified unchanged{mesh, 0.0f};
  if (mesh.normals.empty()) SetAngleWeightedNormals(unchanged.mesh);
  if (mesh.triangles.size() <= kFewestTriangles) return unchanged;
  const float scale_mu =
      meshopt_simplifyScale(mesh.vertices.data()->data(), mesh.vertices.size(), sizeof(Eigen::Vector3f));
  if (!(scale_mu > 0)) return unchanged;
  const size_t max_triangles = std::clamp(options.max_triangles, kFewestTriangles, mesh.triangles.size());
  Collapsed collapsed = Collapse(mesh, 0, options.max_error_mu, scale_mu);
  if (collapsed.triangles.size() > max_triangles) {
    // From the original triangles, so that the error refers to them.
    collapsed = Collapse(mesh, max_triangles, std::numeric_limits<float>::max(), scale_mu);
  }
  ManifoldTriangles manifold = MakeManifold(mesh.vertices, std::move(collapsed.triangles));
  if (manifold.triangles.empty()) return unchanged;
  return {WithTriangles(mesh, std::move(manifold)), collapsed.error_mu};
}

std::vector<Simplified> MakeLevels(const Mesh& mesh) {
  std::vector<Simplified> levels;
  size_t triangles = mesh.triangles.size();
  while (levels.size() < kMaxLevels && triangles / kLevelFactor >= kFewestLevelTriangles) {
    Simplified level = SimplifyMesh(mesh, {.max_triangles = triangles / kLevelFactor});
    // Seams of the texture and thin parts limit what can be collapsed.
    if (static_cast<float>(level.mesh.triangles.size()) > kMostOfLevel * static_cast<float>(triangles)) break;
    triangles = level.mesh.triangles.size();
    levels.push_back(std::move(level));
  }
  return levels;
}

}  // namespace romap::texture
