#include "server/texture/align_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "common/mesh_faces.h"
#include "common/parallel_for.h"
#include "common/statistics.h"
#include "server/texture/prepared_view.h"

namespace romap::texture {
namespace {

// Distances to each side, in steps of half a pixel: at 45 degrees, two views from opposite sides differ by 0.7 pixels
// per step.
constexpr int kSteps = 7;
constexpr int kDistances = 2 * kSteps + 1;
constexpr float kStep_px = 0.5f;
constexpr size_t kMostViews = 10;
constexpr size_t kFewestViews = 3;
// Views that show a vertex much worse than the best one see other details.
constexpr float kLeastWeight = 0.25f;
// Rounds in which the costs, and then the distances, are averaged with those of the neighbors.
constexpr int kCostRounds = 10;
constexpr int kDistanceRounds = 16;
// Variance of the noise of images and of the interpolation [gray levels squared]: smaller differences of costs are no
// evidence.
constexpr float kNoiseVariance = 150;
// Weight of the distance 0 against the evidence of a vertex (0..1) when distances are smoothed.
constexpr float kPriorWeight = 0.02f;
constexpr float kNeighborWeight = 4;  // of all neighbors together, against the vertex itself
constexpr size_t kVerticesPerTask = 256;

using Costs = std::array<float, kDistances>;

struct Distance {
  float steps = 0;
  float evidence = 0;  // 0..1
};

// Calls visit(other) for the other corners of the triangles at a vertex: its neighbors, most of them twice.
template <class Visit>
void VisitNeighbors(const Mesh& mesh, const VertexTriangles& triangles, uint32_t vertex, const Visit& visit) {
  for (const uint32_t triangle : triangles.At(vertex)) {
    for (const uint32_t corner : mesh.triangles[triangle]) {
      if (corner != vertex) visit(corner);
    }
  }
}

struct SeenBy {
  const PreparedView* view = nullptr;
  float weight = 0;
};

std::vector<SeenBy> BestViewsOf(const std::vector<PreparedView>& views, const Eigen::Vector3f& position,
                                const Eigen::Vector3f& normal) {
  std::vector<SeenBy> seen_by;
  for (const PreparedView& view : views) {
    const ViewedPoint point = view.Find(position, normal);
    if (point.weight > 0) seen_by.push_back({&view, point.weight});
  }
  std::sort(seen_by.begin(), seen_by.end(), [](const SeenBy& a, const SeenBy& b) { return a.weight > b.weight; });
  while (!seen_by.empty() &&
         (seen_by.size() > kMostViews || seen_by.back().weight < kLeastWeight * seen_by[0].weight)) {
    seen_by.pop_back();
  }
  return seen_by;
}

// Per distance, the variance of the details over the views. All zero if too few views show the vertex.
Costs CostsOf(const std::vector<PreparedView>& views, const Eigen::Vector3f& position, const Eigen::Vector3f& normal,
              float step_mu) {
  Costs costs = {};
  const std::vector<SeenBy> seen_by = BestViewsOf(views, position, normal);
  if (seen_by.size() < kFewestViews) return costs;
  for (int k = 0; k < kDistances; ++k) {
    const Eigen::Vector3f p = position + static_cast<float>(k - kSteps) * step_mu * normal;
    Eigen::Array3f sum = Eigen::Array3f::Zero(), sum2 = Eigen::Array3f::Zero();
    float weights = 0;
    for (const SeenBy& seen : seen_by) {
      const auto detail_bgr = seen.view->DetailAt(p);
      if (!detail_bgr) return {};  // all distances need the same views
      sum += seen.weight * *detail_bgr;
      sum2 += seen.weight * detail_bgr->square();
      weights += seen.weight;
    }
    const Eigen::Array3f mean = sum / weights;
    costs[k] = std::max((sum2 / weights - mean.square()).sum(), 0.0f);
  }
  return costs;
}

void SmoothCosts(const Mesh& mesh, const VertexTriangles& triangles, std::vector<Costs>& costs) {
  std::vector<Costs> smoothed(costs.size());
  ParallelForRanges(costs.size(), kVerticesPerTask, [&](size_t begin, size_t end) {
    for (size_t vertex = begin; vertex < end; ++vertex) {
      Costs sum = costs[vertex];
      for (float& cost : sum) cost *= 2;
      float count = 2;
      VisitNeighbors(mesh, triangles, static_cast<uint32_t>(vertex), [&](uint32_t other) {
        for (int k = 0; k < kDistances; ++k) sum[k] += costs[other][k];
        ++count;
      });
      for (float& cost : sum) cost /= count;
      smoothed[vertex] = sum;
    }
  });
  costs.swap(smoothed);
}

// The minimum of the costs, between the distances.
Distance BestDistance(const Costs& costs) {
  const int best = static_cast<int>(std::min_element(costs.begin(), costs.end()) - costs.begin());
  if (best == 0 || best == kDistances - 1) return {};
  const float before = costs[best - 1], at = costs[best], after = costs[best + 1];
  const float curvature = before - 2 * at + after;
  const float shift = curvature > 0 ? 0.5f * (before - after) / curvature : 0;
  // How much worse the distances beyond two pixels are, on the side where they are less so.
  const int reach = 4;
  float beyond = std::numeric_limits<float>::max();
  for (const int k : {best - reach, best + reach}) {
    if (k >= 0 && k < kDistances) beyond = std::min(beyond, costs[k]);
  }
  const float rise = beyond - at;
  return {.steps = static_cast<float>(best - kSteps) + shift,
          .evidence = std::clamp(rise / (rise + 2 * at + kNoiseVariance), 0.0f, 1.0f)};
}

void SmoothDistances(const Mesh& mesh, const VertexTriangles& triangles, const std::vector<Distance>& found,
                     std::vector<Distance>& distances) {
  std::vector<Distance> smoothed(distances.size());
  for (uint32_t vertex = 0; vertex < distances.size(); ++vertex) {
    const auto count = static_cast<float>(2 * triangles.At(vertex).size() + 1);
    float weight = kPriorWeight + found[vertex].evidence, sum = found[vertex].evidence * found[vertex].steps;
    float evidence = distances[vertex].evidence / count;
    VisitNeighbors(mesh, triangles, vertex, [&](uint32_t other) {
      const float share = distances[other].evidence / count;
      weight += kNeighborWeight * share;
      sum += kNeighborWeight * share * distances[other].steps;
      evidence += share;
    });
    smoothed[vertex] = {sum / weight, std::max(evidence, found[vertex].evidence)};
  }
  distances.swap(smoothed);
}

}  // namespace

SurfaceAlignment AlignSurface(std::span<const TrainingCamera> views, Mesh& mesh) {
  if (views.size() < kFewestViews || mesh.normals.size() != mesh.vertices.size()) return {};
  std::vector<PreparedView> prepared;
  prepared.reserve(views.size());
  for (const TrainingCamera& view : views) prepared.emplace_back(view, mesh);
  std::vector<double> resolutions = ResolutionsAt(views, Eigen::Vector3f::Zero());
  if (resolutions.empty()) return {};
  const auto step_mu = static_cast<float>(kStep_px / Median(std::move(resolutions)));

  std::vector<Costs> costs(mesh.vertices.size());
  ParallelForRanges(costs.size(), kVerticesPerTask, [&](size_t begin, size_t end) {
    for (size_t vertex = begin; vertex < end; ++vertex) {
      costs[vertex] = CostsOf(prepared, mesh.vertices[vertex], mesh.normals[vertex], step_mu);
    }
  });
  const VertexTriangles triangles(mesh);
  for (int round = 0; round < kCostRounds; ++round) SmoothCosts(mesh, triangles, costs);
  std::vector<Distance> found;
  found.reserve(costs.size());
  for (const Costs& of_vertex : costs) found.push_back(BestDistance(of_vertex));
  std::vector<Distance> distances = found;
  for (int round = 0; round < kDistanceRounds; ++round) SmoothDistances(mesh, triangles, found, distances);

  SurfaceAlignment alignment;
  size_t moved = 0;
  for (size_t vertex = 0; vertex < distances.size(); ++vertex) {
    mesh.vertices[vertex] += distances[vertex].steps * step_mu * mesh.normals[vertex];
    if (found[vertex].evidence > 0.2f) {
      ++moved;
      alignment.mean_mu += distances[vertex].steps * step_mu;
    }
  }
  if (moved > 0) alignment.mean_mu /= static_cast<double>(moved);
  alignment.moved_share = static_cast<double>(moved) / static_cast<double>(std::max<size_t>(mesh.vertices.size(), 1));
  return alignment;
}

}  // namespace romap::texture
