#include "server/texture/charts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "common/mesh_faces.h"
#include "server/texture/chart_plane.h"
#include "server/texture/mesh_edges.h"
#include "server/texture/normal_clusters.h"

namespace romap::texture {
namespace {

constexpr int kNormalPasses = 2;
// Triangles with a smaller share of the area have no area: their shape is that of rounding errors.
constexpr float kNoAreaShare = 1e-10f;
constexpr float kMostCells = 512;  // along the diagonal of the mesh

// Of the grids of the charts: about the length of an edge, but large enough that even the longest triangle of a thin
// mesh touches few cells.
float CellSize(const Mesh& mesh, float total_area_mu2) {
  if (mesh.triangles.empty()) return 1;
  const float size_mu = std::max(std::sqrt(2 * total_area_mu2 / static_cast<float>(mesh.triangles.size())),
                                 BoundsOf(mesh).diagonal().norm() / kMostCells);
  return size_mu > 0 ? size_mu : 1;
}

class ChartBuilder {
 public:
  ChartBuilder(const Mesh& mesh, const ChartOptions& options)
      : mesh_(mesh),
        options_(options),
        neighbors_(FindFaceNeighbors(mesh.triangles)),
        shapes_(mesh),
        smooth_(SmoothFaceNormals(neighbors_, shapes_, kNormalPasses)),
        chart_of_(mesh.triangles.size(), kNoCluster),
        cell_mu_(CellSize(mesh, shapes_.total_area_mu2)) {}

  std::vector<Chart> Build() {
    const NormalClusters clusters = ClusterNormals(mesh_, neighbors_, shapes_, smooth_, options_.max_angle_rad);
    for (uint32_t cluster = 0; cluster < clusters.seed.size(); ++cluster) GrowInCluster(clusters, cluster);
    MoveRestToNeighbors();
    GrowRest();
    MergeSmall();
    return Result();
  }

 private:
  struct Work {
    Chart chart;
    ChartPlane plane;
    float area_mu2 = 0;
  };

  bool HasArea(uint32_t face) const { return shapes_.area_mu2[face] > kNoAreaShare * shapes_.total_area_mu2; }

  uint32_t NewChart(const Eigen::Vector3f& normal) {
    charts_.push_back({{normal, {}}, ChartPlane(normal, cell_mu_), 0.0f});
    return static_cast<uint32_t>(charts_.size() - 1);
  }

  bool TryAdd(uint32_t face, uint32_t to) {
    Work& work = charts_[to];
    if (HasArea(face)) {
      if (shapes_.normal[face].dot(work.chart.normal) < std::cos(kMaxFaceAngle_rad)) return false;
      const auto& [a, b, c] = mesh_.triangles[face];
      if (!work.plane.TryAdd({mesh_.vertices[a], mesh_.vertices[b], mesh_.vertices[c]})) return false;
    }
    work.chart.faces.push_back(face);
    work.area_mu2 += shapes_.area_mu2[face];
    chart_of_[face] = to;
    return true;
  }

  // Adds connected triangles that satisfy `may_add` to a chart, beginning with the seed.
  template <class MayAdd>
  void Grow(uint32_t chart, uint32_t seed, const MayAdd& may_add) {
    std::deque<uint32_t> open = {seed};
    while (!open.empty()) {
      const uint32_t face = open.front();
      open.pop_front();
      if (chart_of_[face] != kNoCluster || !TryAdd(face, chart)) continue;
      for (const uint32_t next : neighbors_[face]) {
        if (next != kNoFace && chart_of_[next] == kNoCluster && may_add(next)) open.push_back(next);
      }
    }
  }

  void GrowInCluster(const NormalClusters& clusters, uint32_t cluster) {
    if (faces_of_cluster_.empty()) {
      faces_of_cluster_.resize(clusters.seed.size());
      for (uint32_t face = 0; face < clusters.of_face.size(); ++face) {
        if (clusters.of_face[face] != kNoCluster) faces_of_cluster_[clusters.of_face[face]].push_back(face);
      }
    }
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (const uint32_t face : faces_of_cluster_[cluster]) sum += shapes_.area_mu2[face] * shapes_.normal[face];
    if (!(sum.norm() > 0)) return;
    const Eigen::Vector3f normal = sum.normalized();
    const float min_cosine = std::cos(options_.max_angle_rad);
    Grow(NewChart(normal), clusters.seed[cluster],
         [&](uint32_t face) { return clusters.of_face[face] == cluster && smooth_[face].dot(normal) >= min_cosine; });
  }

  // Adds a triangle to the neighboring chart with the most similar normal that it can be added to.
  bool AddToNeighbor(uint32_t face, uint32_t except) {
    std::array<std::pair<float, uint32_t>, 3> candidates;
    candidates.fill({std::numeric_limits<float>::max(), kNoCluster});
    size_t count = 0;
    for (const uint32_t next : neighbors_[face]) {
      if (next == kNoFace || chart_of_[next] == kNoCluster || chart_of_[next] == except) continue;
      candidates[count++] = {-charts_[chart_of_[next]].chart.normal.dot(smooth_[face]), chart_of_[next]};
    }
    std::sort(candidates.begin(), candidates.end());
    for (size_t i = 0; i < count; ++i) {
      if (TryAdd(face, candidates[i].second)) return true;
    }
    return false;
  }

  void MoveRestToNeighbors() {
    std::deque<uint32_t> open;
    for (uint32_t face = 0; face < chart_of_.size(); ++face) {
      if (chart_of_[face] == kNoCluster) open.push_back(face);
    }
    while (!open.empty()) {
      const uint32_t face = open.front();
      open.pop_front();
      if (chart_of_[face] != kNoCluster || !AddToNeighbor(face, kNoCluster)) continue;
      for (const uint32_t next : neighbors_[face]) {
        if (next != kNoFace && chart_of_[next] == kNoCluster) open.push_back(next);
      }
    }
  }

  // New charts for the remaining triangles, the largest first.
  void GrowRest() {
    std::vector<uint32_t> rest;
    for (uint32_t face = 0; face < chart_of_.size(); ++face) {
      if (chart_of_[face] == kNoCluster) rest.push_back(face);
    }
    std::stable_sort(rest.begin(), rest.end(),
                     [&](uint32_t a, uint32_t b) { return shapes_.area_mu2[a] > shapes_.area_mu2[b]; });
    const float min_cosine = std::cos(options_.max_angle_rad);
    for (const uint32_t seed : rest) {
      if (chart_of_[seed] != kNoCluster) continue;
      const Eigen::Vector3f normal = HasArea(seed) ? shapes_.normal[seed] : Eigen::Vector3f::UnitZ();
      Grow(NewChart(normal), seed,
           [&](uint32_t face) { return shapes_.normal[face].dot(normal) >= min_cosine || !HasArea(face); });
    }
  }

  void MergeSmall() {
    std::vector<uint32_t> order(charts_.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](uint32_t a, uint32_t b) { return charts_[a].area_mu2 < charts_[b].area_mu2; });
    for (const uint32_t chart : order) {
      if (charts_[chart].area_mu2 < options_.min_area_share * shapes_.total_area_mu2) TryDissolve(chart);
    }
  }

  // Moves all triangles of a chart to its neighbors, or none.
  void TryDissolve(uint32_t chart) {
    std::deque<uint32_t> open(charts_[chart].chart.faces.begin(), charts_[chart].chart.faces.end());
    std::vector<uint32_t> moved;
    size_t failures = 0;  // since the last move
    while (!open.empty() && failures < open.size()) {
      const uint32_t face = open.front();
      open.pop_front();
      if (AddToNeighbor(face, chart)) {
        moved.push_back(face);
        failures = 0;
      } else {
        open.push_back(face);
        ++failures;
      }
    }
    if (open.empty()) {
      charts_[chart].chart.faces.clear();
      return;
    }
    for (; !moved.empty(); moved.pop_back()) {
      const uint32_t face = moved.back();
      Work& work = charts_[chart_of_[face]];
      if (HasArea(face)) work.plane.ShrinkTo(work.plane.Count() - 1);
      work.chart.faces.pop_back();
      work.area_mu2 -= shapes_.area_mu2[face];
      chart_of_[face] = chart;
    }
  }

  std::vector<Chart> Result() {
    std::vector<Chart> result;
    for (Work& work : charts_) {
      if (!work.chart.faces.empty()) result.push_back(std::move(work.chart));
    }
    return result;
  }

  const Mesh& mesh_;
  const ChartOptions options_;
  const std::vector<FaceNeighbors> neighbors_;
  const FaceShapes shapes_;
  const std::vector<Eigen::Vector3f> smooth_;  // smoothed normals of the triangles
  std::vector<uint32_t> chart_of_;             // of each triangle
  const float cell_mu_;
  std::vector<std::vector<uint32_t>> faces_of_cluster_;
  std::vector<Work> charts_;
};

}  // namespace

std::vector<Chart> DivideIntoCharts(const Mesh& mesh, const ChartOptions& options) {
  return ChartBuilder(mesh, options).Build();
}

}  // namespace romap::texture
